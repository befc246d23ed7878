// The models of a sweep: every combination of the values that the options list.
#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "models/training/recipe.h"

namespace supertac {

/// "paper_t256_l10_x4_c32_r3_s0": all but the last part is the same for all seeds.
std::string model_name_of(const Recipe& recipe);

/// --preset, --timesteps, --latent, --scale, --channels, --rcabs, --seeds: comma lists.
void declare_grid(Arguments& a);

/// What supertac-train would train with each combination; seeds change fastest. Throws UsageError, also for a
/// combination that no model can have.
std::vector<Recipe> grid_of(const Arguments& a);

}  // namespace supertac
