#include "apps/sweep/shards.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "apps/sweep/sweep.h"
#include "apps/sweep/table.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

struct Part {
  std::int64_t number = 0, of = 0;
};

std::optional<Part> part_of(const std::string& text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos) return std::nullopt;
  const auto number = parse_int(text.substr(0, slash)), of = parse_int(text.substr(slash + 1));
  if (!number || !of || *number < 1 || *number > *of) return std::nullopt;
  return Part{*number, *of};
}

struct Shard {
  Part part;
  nlohmann::ordered_json settings;  // without what tells shards apart
  std::vector<std::string> grid;
  SweepTable table;
};

Shard read_shard(const std::string& folder) {
  const std::string path = folder + "/settings.json";
  auto settings = parse_json_limited(read_text_file(path, 1 << 24), {.max_bytes = 1 << 24});
  const auto part =
      settings.contains(kShardKey) ? part_of(settings[kShardKey].get<std::string>()) : std::nullopt;
  if (!part) throw FileError(path, "this sweep did not run with --shard I/N");
  auto grid = settings.at(kGridKey).get<std::vector<std::string>>();
  settings.erase(kShardKey);
  return {*part, std::move(settings), std::move(grid), SweepTable(folder + "/sweep.csv")};
}

void check_row(const std::string& folder, const Shard& shard,
               const std::map<std::string, std::string>& owners, const std::string& model) {
  if (std::find(shard.grid.begin(), shard.grid.end(), model) == shard.grid.end())
    throw FileError(folder, "has a row of " + model + ", which is not in the grid");
  if (const auto other = owners.find(model); other != owners.end())
    throw FileError(folder, "has a row of " + model + ", and so has " + other->second + "; give one of them");
}

}  // namespace

void declare_shards(Arguments& a) {
  a.option("shard", "I/N",
           "train only part I of N of the grid, I from 1, in an --out of its own (job arrays)");
  a.decides_nothing();
}

std::vector<std::string> names_of(const std::vector<GridPoint>& grid) {
  std::vector<std::string> names;
  for (const GridPoint& point : grid) names.push_back(point.name());
  return names;
}

std::vector<GridPoint> shard_of(const Arguments& a, const std::vector<GridPoint>& grid) {
  if (!a.given("shard")) return grid;
  const auto part = part_of(a.text("shard"));
  if (!part) throw UsageError("--shard: expected I/N with I from 1 to N, found " + a.text("shard"));
  const std::vector<std::string> dealt = names_of(longest_first(grid));
  std::vector<GridPoint> mine;
  for (const GridPoint& point : grid) {
    const auto place = std::find(dealt.begin(), dealt.end(), point.name()) - dealt.begin();
    if (place % part->of == part->number - 1) mine.push_back(point);
  }
  return mine;
}

void merge_shards(const std::vector<std::string>& folders, const std::string& out) {
  std::vector<Shard> shards;
  std::map<std::string, std::string> owners;  // of rows: folder by model
  for (const std::string& folder : folders) {
    shards.push_back(read_shard(folder));
    const Shard& shard = shards.back();
    if (shard.settings != shards.front().settings || shard.part.of != shards.front().part.of)
      throw FileError(
          folder, "is a shard of another sweep than " + folders.front() + "; compare their settings.json");
    for (const SweepTable::Row& row : shard.table.rows()) {
      check_row(folder, shard, owners, row[0]);
      owners[row[0]] = folder;
    }
  }
  const std::vector<std::string>& grid = shards.front().grid;
  for (const std::string& model : grid)
    if (!owners.contains(model))
      throw FileError(out, "no shard has a row of " + model + "; give all " +
                               std::to_string(shards.front().part.of) +
                               " shards, and start one that was stopped again");
  SweepTable table(out + "/sweep.csv");
  if (!table.rows().empty()) throw FileError(out, "holds a sweep already; choose another --out");
  make_directories(out + "/models");
  for (const Shard& shard : shards) {
    for (const SweepTable::Row& row : shard.table.rows()) {
      const std::string model = "/models/" + row[0] + ".safetensors";
      fs::copy_file(owners[row[0]] + model, out + model, fs::copy_options::overwrite_existing);
      table.add(row, grid);
    }
  }
}

}  // namespace supertac
