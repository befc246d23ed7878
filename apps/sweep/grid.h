// The models of a sweep: every combination of the values that the options list.
#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "models/networks/supertac_model.h"

namespace supertac {

struct GridPoint {
  SuperTacSettings model;
  std::uint64_t seed = 0;
  /// "paper_t256_l10_x4_c32_r3": the same for all seeds.
  std::string configuration() const;
  /// The configuration and "_s0".
  std::string name() const { return configuration() + "_s" + std::to_string(seed); }
};

/// --preset, --timesteps, --latent, --scale, --channels, --rcabs, --seeds: comma lists.
void declare_grid(Arguments& a);

/// Models of one window length and picture size follow each other; seeds change fastest. Throws UsageError,
/// also for a combination that no model can have.
std::vector<GridPoint> grid_of(const Arguments& a);

}  // namespace supertac
