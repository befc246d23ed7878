// What the answers of all runs add up to: shares with intervals, confusion matrices, tests against the first
// view.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/classify/exam.h"
#include "apps/classify/views.h"
#include "data/scores/statistics.h"

namespace supertac {

/// The answers about one set of windows, counted over all runs.
class Tally {
 public:
  explicit Tally(std::int32_t classes);
  /// One answer of the current run.
  void add(std::size_t pass, std::int32_t label, std::int32_t answer);
  void end_run();

  /// Share of right answers over all runs, and in each.
  double accuracy() const;
  const std::vector<double>& runs() const { return runs_; }
  /// For other passes of the same plates: a bootstrap over the passes.
  Interval interval() const;
  /// p-value of the difference to another tally of the same windows: sign flips over passes.
  double p_against(const Tally& other) const;
  /// Answers "answer" about windows of "label", of all runs.
  std::uint64_t count(std::int32_t label, std::int32_t answer) const;
  std::size_t passes() const { return clusters_.size(); }
  std::uint64_t windows() const;

  nlohmann::ordered_json to_json(const std::vector<std::string>& names) const;

 private:
  std::vector<ClusterCount> clusters() const;
  std::size_t cell(std::int32_t truth, std::int32_t answer) const {
    return static_cast<std::size_t>(truth) * static_cast<std::size_t>(classes_) +
           static_cast<std::size_t>(answer);
  }

  std::int32_t classes_;
  std::vector<std::uint64_t> confusion_;          // [label][answer]
  std::map<std::size_t, ClusterCount> clusters_;  // by pass
  ClusterCount run_;
  std::vector<double> runs_;
};

/// The answers about one view.
struct ViewResult {
  View view;
  std::vector<Tally> parts;  ///< in the order of Part, each with all windows of the one before
};

/// A line per view, then for each view the confusion matrix inside the texture, in per cent of a row.
std::vector<std::string> tables(const std::vector<ViewResult>& results,
                                const std::vector<std::string>& names);

/// {"frame": {"inside": {...}, "contact": {...}, "all": {...}}, ...}; views after the first also hold
/// "p_against_frame".
nlohmann::ordered_json to_json(const std::vector<ViewResult>& results, const std::vector<std::string>& names);

}  // namespace supertac
