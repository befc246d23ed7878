// Which of a sweep's configurations are worth having.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/sweep/table.h"

namespace supertac {

/// A configuration: the mean over its seeds of every column that holds numbers.
struct Configuration {
  std::string name;
  std::size_t seeds = 0;
  std::map<std::string, double> mean;
  std::vector<std::string> models;
};

/// One line for people, and all for programs.
std::string line_of(const Configuration& c);
nlohmann::ordered_json to_json(const Configuration& c);

/// In the order of the table.
std::vector<Configuration> configurations(const SweepTable& table);

/// Those that no other beats in both accuracy (`ssim`) and speed (`median_us`), fastest first.
std::vector<Configuration> pareto_front(std::vector<Configuration> all);

/// "ssim>=0.8", "position_mm<=0.5": column, >=, <=, > or <, number.
struct Condition {
  std::string column, comparison;
  double bound = 0;
  bool holds(const Configuration& c) const;
};
/// Comma-separated. Throws UsageError for an unknown column or comparison.
std::vector<Condition> conditions_of(const std::string& text);

/// The fastest configuration for which all conditions hold, or nullptr.
const Configuration* cheapest(const std::vector<Configuration>& all,
                              const std::vector<Condition>& conditions);

}  // namespace supertac
