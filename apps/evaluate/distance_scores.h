// How good pictures are by the distance slid over the texture.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"

namespace supertac {

/// Mean SSIM and PSNR of windows in contact, by the distance slid since the first of their pass. Two elements
/// of a texture must have been felt before their distance tells a wide one from a narrow one: what is scored
/// lower before that is not known yet.
class DistanceScores {
 public:
  explicit DistanceScores(const WindowSet& windows) : windows_(windows) {}
  /// Windows of a pass come in the order of time; those not in contact are left out.
  void add(std::uint32_t window, std::span<const float> output, std::span<const float> truth);
  /// For people: nothing when no window was in contact.
  std::vector<std::string> lines() const;
  /// [{"from_mm", "windows", "ssim", "psnr_mean_db"}, ...], without the parts no window fell into.
  nlohmann::ordered_json to_json() const;

 private:
  struct Part {
    double from_mm, ssim = 0, psnr = 0;  // sums
    std::uint64_t windows = 0;
  };
  const WindowSet& windows_;
  std::array<Part, 6> parts_{{{0}, {5}, {10}, {15}, {20}, {30}}};
  std::size_t pass_ = SIZE_MAX;
  WindowSet::Position begin_{};
};

}  // namespace supertac
