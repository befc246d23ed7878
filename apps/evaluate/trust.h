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
  TrustScores(const WindowSet& windows, const ModelFile& model)
      : windows_(windows), model_(model), coverage_(model.interval_factors()) {}
  /// Windows of a pass come in the order of time. Without a predicted error nothing is counted of it.
  void add(const Drawn& drawn);

  /// For people: nothing for a model that says nothing of its pictures.
  std::vector<std::string> lines() const;
  /// {"factor", "coverage", "factor_found", "coverage_of": {"true 0": {"share", "half_width", "pixels"},
  /// "true to 0.2", "true to 0.5", "true above 0.5", "drawn below 0.02" ... "drawn above 0.5"},
  /// "unlike_training"}
  nlohmann::ordered_json to_json() const;

  /// By what is there and by what was drawn, in words; without those that no pixel belongs to.
  std::vector<std::pair<std::string, IntervalCoverage::Held>> classes() const;

 private:
  const WindowSet& windows_;
  const ModelFile& model_;
  IntervalCoverage coverage_;
  std::uint64_t judged_ = 0, unlike_ = 0;
};

}  // namespace supertac
