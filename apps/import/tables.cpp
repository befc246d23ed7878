#include "apps/import/tables.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "data/plates/plate_file.h"
#include "data/recordings/table_import.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

struct TableFile {
  fs::path path;
  std::string group;
};

bool is_table(const fs::path& path) {
  static const std::set<std::string> kinds = {".csv", ".txt", ".tsv", ".npy"};
  return kinds.contains(path.extension().string());
}

std::vector<TableFile> tables_of(const std::string& input, const std::string& group) {
  if (!fs::is_directory(input)) return {{input, group}};
  std::vector<TableFile> tables;
  for (const auto& entry : fs::directory_iterator(input)) {
    if (!entry.is_directory() && is_table(entry.path())) tables.push_back({entry.path(), group});
    if (!entry.is_directory()) continue;
    for (const auto& below : fs::directory_iterator(entry.path()))
      if (is_table(below.path()))
        tables.push_back({below.path(), group.empty() ? entry.path().filename().string() : group});
  }
  std::ranges::sort(tables, {}, &TableFile::path);
  if (tables.empty()) throw FileError(input, "holds no table: expected *.csv, *.txt, *.tsv or *.npy");
  return tables;
}

/// What stands beside a table: FILE itself, or the file of the table's name in the folder FILE.
std::string companion(const Arguments& arguments, const std::string& option, const fs::path& table) {
  const std::string named = arguments.text(option);
  if (named.empty() || !fs::is_directory(named)) return named;
  for (const auto& entry : fs::directory_iterator(named))
    if (is_table(entry.path()) && entry.path().stem() == table.stem()) return entry.path().string();
  throw FileError(named, "holds no table of the name " + table.stem().string() + " for --" + option);
}

}  // namespace

void declare_tables(Arguments& arguments) {
  arguments
      .option("sensor", "FILE",
              "the input is tables of this sensor's frames: a row a frame, *.csv, *.txt, *.tsv or *.npy "
              "(docs/sensors.md)")
      .only_with("sensor")
      .option("columns", "MAP",
              "time=COLUMN:ms,x=COLUMN,y=COLUMN,values=FIRST-LAST; by name or number from 0; without time "
              "rows come at the sensor's rate")
      .option("plate", "NAME", "what the passes slide over: a plate's name, or an STL file", "unknown")
      .option("positions", "FILE", "table of time, x and y (mm) by the same clock; or a folder of them")
      .option("truth", "FILE",
              "array [frames,height,width] of what a finer sensor saw (.npy); or a folder of them")
      .option("truth-range", "LOW,HIGH", "what is 0 and what is 1 in --truth", "0,1")
      .option("group", "GROUP", "person, object or day, for split group; default: the folder's name")
      .only_with("");
}

int import_tables(const Arguments& arguments, const std::string& input) {
  const Sensor sensor = read_sensor(arguments.text("sensor"));
  const ColumnMap map = read_option("columns", [&] { return column_map(arguments.text("columns")); });
  const std::vector<double> range = arguments.numbers("truth-range", -1e30, 1e30);
  if (range.size() != 2 || range[0] == range[1])
    throw UsageError("--truth-range: expected two different numbers, LOW,HIGH");
  const std::string plate = arguments.text("plate");
  const bool is_stl = plate.ends_with(".stl");
  if (!is_stl && !is_unknown_plate(plate)) read_option("plate", [&] { return Plate::named(plate); });
  OutputFolder folder(arguments.output("out"));
  if (is_stl) keep_plate_file(plate, folder.path());
  std::optional<Progress> bar;
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  const std::vector<TableFile> tables = tables_of(input, arguments.text("group"));
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < tables.size(); ++i) {
    stop_if_interrupted();
    if (!bar) bar.emplace(arguments, "importing", tables.size(), "files");
    bar->update(i);
    const std::string path = tables[i].path.string();
    try {
      const Table table = read_table(path);
      Recording recording = recording_of_table(path, table, map, sensor);
      if (const std::string file = companion(arguments, "positions", path); !file.empty())
        add_positions(recording, file, read_table(file), map.time_unit_s);
      if (const std::string file = companion(arguments, "truth", path); !file.empty())
        add_truth(recording, file, read_table(file), range[0], range[1]);
      recording.plate = is_stl ? fs::path(plate).filename().string() : plate;
      recording.trial = 1, recording.pass = static_cast<int>(files.size()) + 1;
      recording.metadata["file"] = tables[i].path.filename().string();
      if (!tables[i].group.empty()) recording.metadata["group"] = tables[i].group;
      add_parent_file("table", path);
      write_recording(folder.add(recording_file_name(recording)), recording);
      arguments.print(path + ": " + std::to_string(recording.frames()) + " frames in " +
                      format(recording.time_s.back() - recording.time_s.front(), 2) + " s" +
                      (table.dropped > 0 ? ", " + std::to_string(table.dropped) + " lines dropped" : ""));
      files.push_back({{"file", path},
                       {"frames", recording.frames()},
                       {"dropped", table.dropped},
                       {"positions", !recording.position_mm.empty()},
                       {"truth", !recording.truth.empty()}});
    } catch (const FileError& error) {
      if (!arguments.flag("skip-bad"))
        throw FileError(error.path(), std::string(error.what()).substr(error.path().size() + 2) +
                                          (tables.size() > 1 ? " (--skip-bad leaves such files out)" : ""));
      arguments.note(std::string("left out: ") + error.what());
      ++left_out;
    }
  }
  bar.reset();
  if (files.empty()) throw FileError(input, "holds no table that could be imported");
  folder.keep();
  arguments.write_json({{"folder", arguments.text("out")},
                        {"recordings", files.size()},
                        {"left_out", left_out},
                        {"files", files}});
  arguments.print(std::to_string(files.size()) + " recordings in " + arguments.text("out"));
  return kExitOk;
}

}  // namespace supertac
