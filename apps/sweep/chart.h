#pragma once

#include <string>
#include <vector>

#include "apps/sweep/front.h"

namespace supertac {

/// A page with accuracy against latency, every configuration a point and the Pareto front a line; a heat map
/// where two settings were swept; and the table of all. It loads nothing from elsewhere.
std::string sweep_page(std::vector<Configuration> all, const std::string& command, const std::string& commit);

}  // namespace supertac
