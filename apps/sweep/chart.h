#pragma once

#include <string>
#include <vector>

#include "apps/sweep/front.h"

namespace supertac {

/// A page with accuracy against latency, every configuration a point, the Pareto front a line with names; and
/// the table of the front. It loads nothing from elsewhere.
std::string sweep_page(const std::vector<Configuration>& all, const std::string& command,
                       const std::string& commit);

}  // namespace supertac
