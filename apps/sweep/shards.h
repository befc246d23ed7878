// A sweep in parts, for machines that share no folder: job arrays.
#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "apps/sweep/grid.h"

namespace supertac {

/// What settings.json of a shard says besides: "3/8", and the names of the whole grid.
inline constexpr const char *kShardKey = "shard", *kGridKey = "grid";

/// --shard and --merge.
void declare_shards(Arguments& a);

std::vector<std::string> names_of(const std::vector<GridPoint>& grid);

/// The share of --shard I/N in the order of the grid; all without. The trainings are dealt out by their
/// length: none gets all the long ones. Throws UsageError.
std::vector<GridPoint> shard_of(const Arguments& a, const std::vector<GridPoint>& grid);

/// Makes `out` the sweep whose shards are these folders: table and models. Throws FileError when shards are
/// of different sweeps, one is missing or there twice, or one has not all its rows; nothing is written then.
void merge_shards(const std::vector<std::string>& folders, const std::string& out);

}  // namespace supertac
