#include "apps/sweep/chart.h"

#include "apps/web/chart.h"
#include "apps/web/result_page.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

ChartSeries series(const char* name, const std::vector<Configuration>& list, bool line) {
  ChartSeries points{.name = name, .points = {}, .line = line, .dots = true};
  for (const Configuration& c : list) {
    points.points.emplace_back(c.mean.at("median_us"), c.mean.at("ssim"));
    if (line) points.labels.push_back(c.name);
  }
  return points;
}

std::string cell(const Configuration& c, const char* column, int decimals) {
  return "<td>" + format(c.mean.at(column), decimals) + "</td>";
}

}  // namespace

std::string sweep_page(const std::vector<Configuration>& all, const std::string& command,
                       const std::string& commit) {
  const std::vector<Configuration> front = pareto_front(all);
  std::string rows;
  for (const Configuration& c : front)
    rows += "<tr><td>" + escaped(c.name) + "</td><td>" + std::to_string(c.seeds) + "</td>" +
            cell(c, "median_us", 1) + cell(c, "ssim", 3) + cell(c, "psnr_db", 2) + cell(c, "position_mm", 2) +
            "</tr>";
  return result_page(
      "SuperTac sweep",
      page_section(
          "Accuracy against the time of a picture",
          "processor time at batch 1 on one thread; SSIM of test windows in contact, mean over seeds",
          chart_svg("Contact SSIM", {.label = "one picture, us", .logarithmic = true},
                    {.label = "SSIM", .most = 1},
                    {series("Pareto front", front, true), series("configurations", all, false)})) +
          page_section("The front, fastest first", "no other is both faster and more accurate",
                       page_table({"configuration", "seeds", "one picture, us", "contact SSIM", "PSNR dB",
                                   "position mm"},
                                  rows)) +
          page_section("What made this page", "", page_facts({{"command", command}, {"commit", commit}})));
}

}  // namespace supertac
