// Whether a network knows when its picture is a guess.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/evaluate/scoring.h"
#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/inference/interval.h"

namespace supertac {

/// What a network says of its own pictures against what is true.
class TrustScores {
 public:
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
  struct Window {
    double doubt, predicted_error, ssim, slid_mm;
  };
  double auroc() const;
  double ssim_of_surest(double share) const;
  double width(double from_mm, double to_mm) const;

  const WindowSet& windows_;
  const ModelFile& model_;
  IntervalCoverage coverage_;
  std::vector<Window> contact_;
  std::size_t in_contact_of_ = SIZE_MAX;
  double begin_mm_ = 0;
  std::uint64_t judged_ = 0, unlike_ = 0;
};

}  // namespace supertac
