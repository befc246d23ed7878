// Whether a network knows when its picture is a guess.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "apps/evaluate/scoring.h"
#include "data/windows/windows.h"
#include "models/files/model_file.h"

namespace supertac {

/// What a network says of its own pictures against what is true. An interval of a pixel is
///   picture +- factor * max(predicted error, 0.01)
/// and should hold the truth in kCovered of the pixels. The factor that does so is found with the pass as the
/// unit (windows of one pass are not exchangeable: Dunn, Wasserman, Ramdas 2018): each pass counts the same.
class TrustScores {
 public:
  static constexpr double kCovered = 0.9;

  /// `model`: whose factor and novelty are judged; must outlive this, as the windows.
  TrustScores(const WindowSet& windows, const ModelFile& model) : windows_(windows), model_(model) {}
  /// Windows of a pass come in the order of time. Without a predicted error nothing is counted of it.
  void add(const Drawn& drawn);

  /// For people: nothing for a model that says nothing of its pictures.
  std::vector<std::string> lines() const;
  /// {"factor", "coverage", "factor_found", "sure_ssim", "auroc", "predicted_error_near",
  /// "predicted_error_far", "unlike_training"}
  nlohmann::ordered_json to_json() const;

 private:
  static constexpr std::size_t kBins = 400;  // of |error| / predicted error
  static constexpr double kBinsPerUnit = 20;
  struct Pass {
    std::array<std::uint64_t, kBins> ratios{};
    std::uint64_t pixels = 0;
  };
  struct Window {
    double doubt, predicted_error, ssim, felt_mm;
  };
  double coverage(double factor) const;
  double factor_found() const;
  double auroc() const;
  double ssim_of_surest(double share) const;
  double width(double from_mm, double to_mm) const;

  const WindowSet& windows_;
  const ModelFile& model_;
  std::vector<Pass> passes_;
  std::vector<Window> contact_;
  std::size_t pass_ = SIZE_MAX, in_contact_of_ = SIZE_MAX;
  double begin_mm_ = 0;
  std::uint64_t judged_ = 0, unlike_ = 0;
};

}  // namespace supertac
