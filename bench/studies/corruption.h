// Twelve ways in which a sensor or its rig gets worse, five severities each, in the form of ImageNet-C
// (Hendrycks and Dietterich 2019). No network is ever trained on them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace supertac {

struct Corruption {
  const char* name;
  const char* what;    ///< of severity s
  double severity[5];  ///< what s means, for people and for `apply`
  /// Changes a window [T][16] of scaled signals, before it is levelled. `draw` numbers the window.
  void (*apply)(double severity, std::uint64_t draw, std::span<float> window);
};

const std::vector<Corruption>& corruptions();

}  // namespace supertac
