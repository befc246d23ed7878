// What the answers of all runs about one set of windows add up to.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "data/scores/statistics.h"

namespace supertac {

class Tally {
 public:
  explicit Tally(std::size_t classes) : classes_(classes), confusion_(classes * classes) {}
  /// One answer of the current run.
  void add(std::size_t pass, std::int32_t label, std::int32_t answer);
  void end_run();

  /// Share of right answers over all runs.
  double accuracy() const { return share(clusters()); }
  /// For other passes of the same plates: a bootstrap over the passes.
  Interval interval() const { return bootstrap_interval(clusters()); }
  /// p-value of the difference to another tally of the same windows: sign flips over passes.
  double p_against(const Tally& other) const;
  nlohmann::ordered_json to_json(const std::vector<std::string>& names) const;

 private:
  std::vector<ClusterCount> clusters() const;

  std::size_t classes_;
  std::vector<std::uint64_t> confusion_;          // [label][answer]
  std::map<std::size_t, ClusterCount> clusters_;  // by pass
  ClusterCount run_;
  std::vector<double> runs_;
};

}  // namespace supertac
