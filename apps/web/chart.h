// Charts of a result page, as SVG.
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace supertac {

struct ChartAxis {
  std::string label;
  bool logarithmic = false;
  /// What a value cannot be above; the axis ends there, also where its data leave less room.
  double most = std::numeric_limits<double>::infinity();
};

struct ChartSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;
  bool dots = false;
};

/// A chart with a title, its legend under the title and off the points, and round numbers on axes that hold
/// the data and no more. Points that are not finite, or not positive on a logarithmic axis, are left out;
/// empty when none is left. At most four series have colours of their own.
std::string chart_svg(const std::string& title, const ChartAxis& x, const ChartAxis& y,
                      const std::vector<ChartSeries>& series);

/// Round numbers from `low` to `high`, at most some eight: what an axis is labelled with.
std::vector<double> round_numbers(double low, double high, bool logarithmic);

}  // namespace supertac
