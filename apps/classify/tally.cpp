#include "apps/classify/tally.h"

#include <numeric>

namespace supertac {

void Tally::add(std::size_t pass, std::int32_t label, std::int32_t answer) {
  ++confusion_[static_cast<std::size_t>(label) * classes_ + static_cast<std::size_t>(answer)];
  for (ClusterCount* c : {&clusters_[pass], &run_}) {
    c->correct += label == answer ? 1 : 0;
    c->total += 1;
  }
}

void Tally::end_run() { runs_.push_back(share({&run_, 1})), run_ = {}; }

std::vector<ClusterCount> Tally::clusters() const {
  std::vector<ClusterCount> all;
  for (const auto& [pass, count] : clusters_) all.push_back(count);
  return all;
}

double Tally::p_against(const Tally& other) const {
  std::vector<double> differences;
  for (const auto& [pass, count] : clusters_)
    differences.push_back(count.correct - other.clusters_.at(pass).correct);
  return sign_flip_p(differences);
}

nlohmann::ordered_json Tally::to_json(const std::vector<std::string>& names) const {
  const std::uint64_t all = std::accumulate(confusion_.begin(), confusion_.end(), std::uint64_t{0});
  const Interval i = interval();
  nlohmann::ordered_json json = {{"windows", all / runs_.size()},
                                 {"passes", clusters_.size()},
                                 {"accuracy", accuracy()},
                                 {"ci95_passes", {i.low, i.high}},
                                 {"accuracy_of_runs", runs_}};
  for (std::size_t row = 0; row < classes_; ++row)
    for (std::size_t c = 0; c < classes_; ++c)
      json["confusion"][names[row]][names[c]] = confusion_[row * classes_ + c];
  return json;
}

}  // namespace supertac
