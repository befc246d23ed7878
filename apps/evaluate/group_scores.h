// Scores of each person, object or day apart.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "data/scores/metrics.h"
#include "data/windows/windows.h"

namespace supertac {

/// By the recordings' groups; by plate where they have none.
class GroupScores {
 public:
  explicit GroupScores(const WindowSet& windows);
  void add(std::uint32_t window, std::span<const float> picture, std::span<const float> truth);
  /// A line for each group, those with the lowest contact SSIM first, eight at most; none for a single one.
  std::vector<std::string> lines() const;
  /// [{"name", "contact": {...}, "all": {...}}], in the same order.
  nlohmann::ordered_json to_json() const;
  bool by_group() const { return by_group_; }
  std::size_t size() const { return groups_.size(); }

 private:
  std::vector<std::pair<std::string, const ZoneMetrics*>> worst_first() const;

  const WindowSet& windows_;
  bool by_group_;
  std::map<std::string, ZoneMetrics> groups_;
};

/// What a reader of the scores should know: `result` is the evaluation's JSON. That a network is hardly above
/// ridge regression, that its predicted errors tell less than a coin, that few groups were tested.
std::vector<std::string> remarks_on_scores(const nlohmann::ordered_json& result, const GroupScores& groups);

}  // namespace supertac
