#include "apps/classify/report.h"

#include <numeric>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

std::string per_cent(double share, std::size_t width) { return right_aligned(format(100 * share, 1), width); }
std::string range(const Interval& i) {
  return right_aligned(format(100 * i.low, 1) + "-" + format(100 * i.high, 1), 12);
}

constexpr std::size_t kName = 16, kColumn = 11;

void add_confusion(std::vector<std::string>& lines, const ViewResult& result,
                   const std::vector<std::string>& names) {
  std::string head = left_aligned(result.view.name(), kName);
  for (const std::string& name : names) head += right_aligned(name, kColumn);
  lines.push_back(head);
  const auto classes = static_cast<std::int32_t>(names.size());
  for (std::int32_t row = 0; row < classes; ++row) {
    double total = 0;
    for (std::int32_t c = 0; c < classes; ++c)
      total += static_cast<double>(result.parts.front().count(row, c));
    std::string line = left_aligned("  " + names[static_cast<std::size_t>(row)], kName);
    for (std::int32_t c = 0; c < classes; ++c)
      line += per_cent(static_cast<double>(result.parts.front().count(row, c)) / total, kColumn);
    lines.push_back(line);
  }
}

}  // namespace

Tally::Tally(std::int32_t classes)
    : classes_(classes), confusion_(static_cast<std::size_t>(classes * classes)) {}

void Tally::add(std::size_t pass, std::int32_t truth, std::int32_t answer) {
  const double right = truth == answer ? 1 : 0;
  ++confusion_[cell(truth, answer)];
  for (ClusterCount* c : {&clusters_[pass], &run_}) {
    c->correct += right;
    c->total += 1;
  }
}

void Tally::end_run() { runs_.push_back(share({&run_, 1})), run_ = {}; }

std::vector<ClusterCount> Tally::clusters() const {
  std::vector<ClusterCount> all;
  for (const auto& [pass, count] : clusters_) all.push_back(count);
  return all;
}

double Tally::accuracy() const { return share(clusters()); }
Interval Tally::interval() const { return bootstrap_interval(clusters()); }

double Tally::p_against(const Tally& other) const {
  std::vector<double> differences;
  for (const auto& [pass, count] : clusters_)
    differences.push_back(count.correct - other.clusters_.at(pass).correct);
  return sign_flip_p(differences);
}

std::uint64_t Tally::count(std::int32_t truth, std::int32_t answer) const {
  return confusion_[cell(truth, answer)];
}

std::uint64_t Tally::windows() const {
  return std::accumulate(confusion_.begin(), confusion_.end(), std::uint64_t{0});
}

nlohmann::ordered_json Tally::to_json(const std::vector<std::string>& names) const {
  const Interval i = interval();
  nlohmann::ordered_json json = {{"windows", windows() / runs_.size()},
                                 {"passes", passes()},
                                 {"accuracy", accuracy()},
                                 {"ci95_passes", {i.low, i.high}},
                                 {"accuracy_of_runs", runs_}};
  for (std::int32_t row = 0; row < classes_; ++row) {
    for (std::int32_t c = 0; c < classes_; ++c) {
      json["confusion"][names[static_cast<std::size_t>(row)]][names[static_cast<std::size_t>(c)]] =
          count(row, c);
    }
  }
  return json;
}

std::vector<std::string> tables(const std::vector<ViewResult>& results,
                                const std::vector<std::string>& names) {
  std::string head(kName, ' '), columns = head;
  for (const char* part : kParts) {
    head += "  |- " + left_aligned(std::string(part) + " ", 24) + "|";
    columns += "   right   95 % passes      p";
  }
  std::vector<std::string> lines{head, columns};
  for (const ViewResult& r : results) {
    std::string line = left_aligned(r.view.name(), kName);
    for (std::size_t p = 0; p < r.parts.size(); ++p) {
      const bool first = &r == &results.front();
      line += per_cent(r.parts[p].accuracy(), 8) + "  " + range(r.parts[p].interval()) +
              right_aligned(first ? "-" : format(r.parts[p].p_against(results.front().parts[p]), 4), 7);
    }
    lines.push_back(line);
  }
  lines.push_back("inside, rows: plate, columns: answer, %");
  for (const ViewResult& r : results) add_confusion(lines, r, names);
  return lines;
}

nlohmann::ordered_json to_json(const std::vector<ViewResult>& results,
                               const std::vector<std::string>& names) {
  nlohmann::ordered_json json;
  const ViewResult& first = results.front();
  for (const ViewResult& r : results) {
    for (std::size_t p = 0; p < r.parts.size(); ++p) {
      auto& part = json[r.view.name()][kParts[p]];
      part = r.parts[p].to_json(names);
      if (&r != &first) part["p_against_" + first.view.name()] = r.parts[p].p_against(first.parts[p]);
    }
  }
  return json;
}

}  // namespace supertac
