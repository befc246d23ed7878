#include "apps/sweep/front.h"

#include <algorithm>

#include "apps/common/command_line/arguments.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {

std::vector<Configuration> configurations(const SweepTable& table) {
  std::vector<Configuration> all;
  for (const SweepTable::Row& row : table.rows()) {
    const std::string& model = row.front();
    const std::string name = model.substr(0, model.rfind("_s"));
    auto found = std::ranges::find(all, name, &Configuration::name);
    if (found == all.end()) found = all.insert(all.end(), {name, 0, {}, {}});
    ++found->seeds;
    found->models.push_back(model);
    for (std::size_t i = 0; i < row.size(); ++i)
      if (const SweepColumn& column = sweep_columns()[i]; !column.text)
        found->mean[column.name] += parse_double(row[i]).value_or(std::nan(""));
  }
  for (Configuration& c : all)
    for (auto& [column, sum] : c.mean) sum /= static_cast<double>(c.seeds);
  return all;
}

std::vector<Configuration> pareto_front(std::vector<Configuration> all) {
  std::ranges::stable_sort(all, {}, [](const Configuration& c) { return c.mean.at("median_us"); });
  std::vector<Configuration> front;
  for (Configuration& c : all) {
    const double ssim = c.mean.at("ssim");
    if (ssim == ssim && (front.empty() || ssim > front.back().mean.at("ssim"))) front.push_back(std::move(c));
  }
  return front;
}

bool Condition::holds(const Configuration& c) const {
  const double value = c.mean.at(column);
  if (comparison == ">=") return value >= bound;
  if (comparison == "<=") return value <= bound;
  return comparison == ">" ? value > bound : value < bound;
}

std::vector<Condition> conditions_of(const std::string& text) {
  std::vector<Condition> conditions;
  for (const std::string& part : comma_list(text + ",")) {
    const std::size_t sign = part.find_first_of("<>");
    const std::size_t value = sign == std::string::npos ? sign : part.find_first_not_of("<>=", sign);
    Condition c;
    if (value != std::string::npos) {
      c.column = part.substr(0, sign);
      c.comparison = part.substr(sign, value - sign);
      c.bound = parse_double(part.substr(value)).value_or(std::nan(""));
    }
    const bool known = std::ranges::any_of(
        sweep_columns(), [&](const SweepColumn& k) { return !k.text && k.name == c.column; });
    const bool comparable =
        c.comparison == ">" || c.comparison == "<" || c.comparison == ">=" || c.comparison == "<=";
    if (!known || !comparable || c.bound != c.bound) {
      throw UsageError(
          "--pick expects conditions like \"ssim>=0.8,position_mm<=0.5\" on columns of sweep.csv, found \"" +
          part + "\"");
    }
    conditions.push_back(std::move(c));
  }
  return conditions;
}

const Configuration* cheapest(const std::vector<Configuration>& all,
                              const std::vector<Condition>& conditions) {
  const Configuration* best = nullptr;
  for (const Configuration& c : all) {
    const bool good = std::ranges::all_of(conditions, [&](const Condition& k) { return k.holds(c); });
    if (good && (best == nullptr || c.mean.at("median_us") < best->mean.at("median_us"))) best = &c;
  }
  return best;
}

nlohmann::ordered_json to_json(const Configuration& c) {
  nlohmann::ordered_json json = {{"configuration", c.name}, {"seeds", c.seeds}, {"models", c.models}};
  for (const SweepColumn& column : sweep_columns())
    if (!column.text && column.name != "seed") json[column.name] = c.mean.at(column.name);
  return json;
}

std::string line_of(const Configuration& c) {
  return c.name + ": SSIM " + format(c.mean.at("ssim"), 3) + ", PSNR " + format(c.mean.at("psnr_db"), 1) +
         " dB, " + format(c.mean.at("median_us"), 1) + " us, " + format(c.mean.at("mmac"), 2) + " MMAC, " +
         std::to_string(c.seeds) + " seed(s)";
}

}  // namespace supertac
