// An evaluation as one page that needs nothing from elsewhere.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "apps/evaluate/scoring.h"
#include "data/scores/metrics.h"
#include "data/windows/windows.h"
#include "models/inference/compiled/compiled_model.h"

namespace supertac {

/// Scores beside those of the baselines, by group or plate (the worst first), zone and distance since the
/// first contact; the three worst windows in contact of each of the eight worst groups; the twelve worst
/// windows in contact, and the twelve best of those with texture on a quarter of the picture, no two of them
/// within 3 mm of one pass; and what made it all.
class EvaluationPage {
 public:
  explicit EvaluationPage(const WindowSet& windows) : windows_(windows) {}
  /// A window in contact and its SSIM.
  void add(const Drawn& drawn, double ssim);

  /// `result` is the evaluation's JSON; `made_by` says what to repeat it with, a name and a text each. The
  /// windows shown are drawn once more.
  std::string html(const Ensemble& network, const nlohmann::ordered_json& result,
                   const std::vector<std::pair<std::string, std::string>>& made_by) const;

  static constexpr std::size_t kShown = 12, kGroups = 8, kOfGroup = 3;

 private:
  struct ScoredWindow {
    double ssim;
    std::uint32_t window;
    bool full;  ///< a quarter of the truth is texture
  };
  /// Of all groups, or of one.
  std::vector<ScoredWindow> extremes(bool best, const std::string& group = {},
                                     std::size_t most = kShown) const;
  nlohmann::ordered_json shown(const std::vector<ScoredWindow>& chosen, const Ensemble& network) const;
  std::string name_of(std::uint32_t window) const;

  const WindowSet& windows_;
  std::vector<ScoredWindow> contact_;
};

}  // namespace supertac
