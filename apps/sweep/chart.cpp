#include "apps/sweep/chart.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "apps/web/chart.h"
#include "apps/web/result_page.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::pair<const char*, const char*> kAxes[] = {{"timesteps", "T, samples of a window"},
                                                         {"latent", "LD, numbers of a latent"},
                                                         {"scale", "scale"},
                                                         {"channels", "channels"},
                                                         {"rcabs", "blocks (RCAB)"}};

using Configurations = std::vector<Configuration>;

// Labelled by the numbers of the table below.
ChartSeries series(const char* name, const Configurations& all, const Configurations& list, bool line) {
  ChartSeries points{.name = name, .points = {}, .line = line, .dots = true};
  for (const Configuration& c : list) {
    points.points.emplace_back(c.mean.at("median_us"), c.mean.at("ssim"));
    const auto row = std::ranges::find(all, c.name, &Configuration::name);
    points.labels.push_back(std::to_string(row - all.begin() + 1));
  }
  return points;
}

// What was swept, where it was two settings of one preset: the SSIM of each pair.
std::string heat_map(const Configurations& all) {
  std::vector<std::pair<const char*, const char*>> swept;
  std::vector<std::set<double>> found;
  for (const auto& axis : kAxes) {
    std::set<double> values;
    for (const Configuration& c : all) values.insert(c.mean.at(axis.first));
    if (values.size() > 1) swept.push_back(axis), found.push_back(values);
  }
  if (swept.size() != 2 || all.size() > found[0].size() * found[1].size()) return {};
  std::vector<double> ssim(found[0].size() * found[1].size(), std::nan(""));
  HeatMapAxis axes[2];
  for (std::size_t k = 0; k < 2; ++k) {
    axes[k].label = swept[k].second;
    for (const double value : found[k]) axes[k].names.push_back(format(value));
  }
  for (const Configuration& c : all) {
    const auto at = [&](std::size_t k) {
      return static_cast<std::size_t>(
          std::distance(found[k].begin(), found[k].find(c.mean.at(swept[k].first))));
    };
    ssim[at(1) * found[0].size() + at(0)] = c.mean.at("ssim");
  }
  return page_section("Accuracy for each pair of settings", "mean over seeds",
                      heat_map_svg("Contact SSIM", axes[0], axes[1], ssim));
}

std::string cell(const Configuration& c, const char* column, int decimals) {
  return "<td>" + format(c.mean.at(column), decimals) + "</td>";
}

}  // namespace

std::string sweep_page(Configurations all, const std::string& command, const std::string& commit) {
  std::ranges::stable_sort(all, {}, [](const Configuration& c) { return c.mean.at("median_us"); });
  const Configurations front = pareto_front(all);
  const auto on_front = [&](const Configuration& c) {
    return std::ranges::find(front, c.name, &Configuration::name) != front.end();
  };
  Configurations others;
  std::string rows;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Configuration& c = all[i];
    if (!on_front(c)) others.push_back(c);
    std::string name = escaped(c.name);
    for (std::size_t at = 0; (at = name.find('_', at)) != std::string::npos; at += 6)
      name.replace(at, 1, "_<wbr>");
    rows += std::string(on_front(c) ? "<tr class=\"own\">" : "<tr>") + "<td>" + std::to_string(i + 1) +
            "&ensp;" + name + "</td><td>" + std::to_string(c.seeds) + "</td>" + cell(c, "median_us", 1) +
            cell(c, "ssim", 3) + cell(c, "psnr_db", 2) + cell(c, "position_mm", 2) + "</tr>";
  }
  return result_page(
      "SuperTac sweep",
      page_section(
          "Accuracy against the time of a picture",
          "processor time at batch 1 on one thread; SSIM of contact windows, mean over seeds; numbers are "
          "those of the table",
          chart_svg("Contact SSIM", {.label = "one picture, us", .logarithmic = true},
                    {.label = "SSIM", .most = 1},
                    {series("Pareto front", all, front, true), series("dominated", all, others, false)})) +
          heat_map(all) +
          page_section("All configurations, fastest first",
                       "bold: of the Pareto front, no other is both faster and more accurate",
                       page_table({"configuration", "seeds", "one picture, us", "contact SSIM", "PSNR dB",
                                   "position mm"},
                                  rows)) +
          page_section("What made this page", "", page_facts({{"command", command}, {"commit", commit}})));
}

}  // namespace supertac
