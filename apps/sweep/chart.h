#pragma once

#include <string>
#include <vector>

#include "apps/sweep/front.h"

namespace supertac {

/// Accuracy against latency, every configuration a point, the Pareto front a line: writes
/// folder/chart.gnuplot, data included, and has gnuplot draw folder/chart.png. Returns false when gnuplot is
/// not installed or fails; the script is there then all the same. Throws FileError.
std::string draw_chart(const std::string& folder, const std::vector<Configuration>& all);

}  // namespace supertac
