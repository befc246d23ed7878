#include "apps/import/tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>

#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/import/text_folder.h"
#include "data/plates/plate.h"
#include "data/recordings/imports/imports.h"
#include "data/registration/registration.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

struct TableFile {
  fs::path path;
  std::string folder;  // below the input
  std::string group;
};

constexpr const char* kTables[] = {".csv", ".txt", ".tsv", ".npy"};
bool is_recording(const fs::path& path) { return path.extension() == ".safetensors"; }
bool is_table(const fs::path& path) {
  return is_recording(path) || std::ranges::find(kTables, path.extension().string()) != std::end(kTables);
}

std::vector<TableFile> tables_of(const std::string& input, const std::string& group) {
  if (!fs::is_directory(input)) return {{input, "", group}};
  std::vector<TableFile> tables;
  const auto take = [&](const fs::path& folder, const std::string& name) {
    for (const fs::path& path : entries_of(folder, false))
      if (is_table(path)) tables.push_back({path, name, group.empty() ? name : group});
  };
  take(input, "");
  for (const fs::path& folder : entries_of(input, true)) take(folder, folder.filename().string());
  std::ranges::sort(tables, {}, &TableFile::path);
  if (tables.empty())
    throw FileError(input, "holds no table: expected *.csv, *.txt, *.tsv, *.npy or recordings");
  return tables;
}

/// What stands beside a table: FILE itself, or the table of its name in the folder FILE, where tables of a
/// folder have a folder of that name.
std::string companion(const Arguments& arguments, const std::string& option, const TableFile& table) {
  const std::string named = arguments.text(option);
  if (named.empty() || !fs::is_directory(named)) return named;
  const fs::path folder = fs::path(named) / table.folder;
  const std::string stem = table.path.stem().string();
  std::string found;
  for (const fs::path& path : entries_of(folder, false)) {
    if (path.stem() != stem || !is_table(path) || is_recording(path)) continue;
    if (!found.empty()) throw FileError(folder.string(), "holds two tables of the name " + stem);
    found = path.string();
  }
  if (found.empty())
    throw FileError(folder.string(), "holds no table of the name " + stem + " for --" + option);
  return found;
}

/// What all tables of an import have in common.
struct TableImport {
  explicit TableImport(const Arguments& a)
      : arguments(a),
        sensor(read_sensor(a.text("sensor"))),
        map(read_option("columns", [&] { return column_map(a.text("columns")); })),
        truth_range(a.numbers("truth-range", -1e30, 1e30)),
        plate_name(a.text("plate")),
        speed_mm_s(a.number("speed", 0.1, 1000)) {
    if (truth_range.size() != 2 || truth_range[0] == truth_range[1])
      throw UsageError("--truth-range: expected two different numbers, LOW,HIGH");
    if (is_unknown_plate(plate_name)) return;
    plate = read_option("plate", [&] { return Plate::named(plate_name); });
    plate_name = fs::path(plate_name).filename().string();
  }

  /// What a table holds, or a recording of this sensor that supertac-stream kept.
  Recording read(const std::string& path, std::size_t& dropped) const {
    if (!is_recording(path)) {
      const Table table = read_table(path);
      dropped = table.dropped;
      return recording_of_table(path, table, map, sensor);
    }
    Recording recording = read_recording(path);
    if (recording.array != sensor.array || recording.signal_scale != sensor.scale)
      throw FileError(path, "was recorded with " + recording.array.text() + " in " +
                                recording.signal_scale.unit + ", the sensor's file says " +
                                sensor.array.text() + " in " + sensor.scale.unit);
    return recording;
  }

  /// Refuses positions that cannot be those of the array on the plate.
  void check_places(const std::string& path, const Recording& recording) const {
    constexpr float kMetresMm = 0.5F;
    const ImageGrid reach = sensor.array.picture(1);
    const double reach_x = reach.width_mm() / 2, reach_y = reach.height_mm() / 2;
    std::array<float, 2> low{1e30F, 1e30F}, high{-1e30F, -1e30F};
    std::size_t known = 0, on = 0, on_exchanged = 0;
    const auto over = [&](double x, double y) {
      return x > -reach_x && x < rig::kPlateWidthMm + reach_x && y > -reach_y &&
             y < rig::kPlateLengthMm + reach_y;
    };
    for (std::size_t i = 0; i + 1 < recording.position_mm.size(); i += 2) {
      const float x = recording.position_mm[i], y = recording.position_mm[i + 1];
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      ++known, on += over(x, y), on_exchanged += over(y, x);
      low = {std::min(low[0], x), std::min(low[1], y)}, high = {std::max(high[0], x), std::max(high[1], y)};
    }
    const bool corner = std::max({-low[0], -low[1], high[0], high[1]}) < kMetresMm;
    constexpr std::size_t kFew = 20;  // one in so many: an array may have been parked beside the plate
    if (known == 0 || (kFew * on >= known && on >= on_exchanged && !corner)) return;
    throw FileError(path, "the array's centre goes from x " + format(low[0], 2) + " to " +
                              format(high[0], 2) + " and y " + format(low[1], 2) + " to " +
                              format(high[1], 2) + ", expected mm on a plate of " +
                              format(rig::kPlateWidthMm) + " x " + format(rig::kPlateLengthMm) +
                              (corner              ? "; are these metres?"
                               : on_exchanged > on ? "; are x and y exchanged?"
                                                   : "; take off the plate's origin"));
  }

  /// The plate of --plate, or the one that a recording names; empty for an unknown one.
  std::optional<Plate> plate_of(const Recording& recording, const fs::path& path) const {
    const bool named = !recording.plate.empty() && !is_unknown_plate(recording.plate) &&
                       recording.plate.find('/') == std::string::npos;  // writing it refuses such a name
    if (plate && named && recording.plate != plate_name)
      throw FileError(path.string(), "was recorded over " + recording.plate + ", --plate says " + plate_name +
                                         "; leave --plate out, and each recording's own plate is taken");
    if (plate || !named) return plate;
    return plate_in_folder(recording.plate, path.parent_path().string());
  }

  /// Positions that no column and no log holds are found from the signals, over a known plate.
  Recording import(const TableFile& file, int pass, std::size_t& dropped,
                   std::optional<Registration>& fit) const {
    const std::string path = file.path.string();
    Recording recording = read(path, dropped);
    const std::optional<Plate> over = plate_of(recording, file.path);
    if (over && !plate) keep_plate_file((file.path.parent_path() / recording.plate).string(), out);
    if (plate || recording.plate.empty()) recording.plate = plate_name;
    recording.trial = std::max(1, recording.trial), recording.pass = pass;
    recording.metadata["file"] = file.path.filename().string();
    if (!file.group.empty()) recording.metadata["group"] = file.group;
    if (const std::string log = companion(arguments, "positions", file); !log.empty())
      add_positions(recording, log, read_table(log), map.time_unit_s);
    if (over) check_places(path, recording);
    if (const std::string images = companion(arguments, "truth", file); !images.empty())
      read_truth(recording, images, companion(arguments, "truth-times", file));
    const bool registers = plate || (over && !over->crests().empty());
    if (registers && recording.position_mm.empty() && recording.truth.empty()) {
      recording.speed_mm_s = speed_mm_s;
      fit = register_pass(recording, *over);
      apply(*fit, recording);
    }
    return recording;
  }

  /// Images for each frame, or a film with a clock of its own.
  void read_truth(Recording& recording, const std::string& path, const std::string& times_path) const {
    Table film = read_table(path);
    const bool table = film.shape.size() == 1;
    if (table && !times_path.empty()) throw FileError(path, "has times of its own; leave --truth-times out");
    std::optional<FilmClock> clock;
    if (table || !times_path.empty()) {
      const std::vector<double> times = table ? take_film_times(path, film, recording.array)
                                              : film_times(times_path, read_table(times_path), film);
      clock = add_film(recording, path, film, times, truth_range[0], truth_range[1]);
    } else {
      add_truth(recording, path, film, truth_range[0], truth_range[1]);
      clock = put_in_time(recording);
      if (clock) arguments.note("warning: " + path + " shows touches at other times than the signals: moved");
    }
    if (clock) arguments.note(path + ": " + clock->text());
  }

  const Arguments& arguments;
  Sensor sensor;
  ColumnMap map;
  std::vector<double> truth_range;
  std::string plate_name;
  double speed_mm_s;
  std::string out;  ///< where the recordings go
  std::optional<Plate> plate;
};

/// What is known of where the array was.
std::string about_positions(const Recording& recording, const std::optional<Registration>& fit) {
  if (fit)
    return fit->reliable ? "positions found, residual " + format(fit->residual, 2) + " mm"
                         : "not reliable: " + fit->reason;
  if (recording.position_mm.empty())
    return recording.truth.empty() ? "no positions: name its plate (--plate), or give --positions or --truth"
                                   : "truth as measured";
  std::size_t known = 0;
  for (std::size_t i = 0; i + 1 < recording.position_mm.size(); i += 2)
    known += std::isfinite(recording.position_mm[i]) && std::isfinite(recording.position_mm[i + 1]);
  return "positions for " + std::to_string(known) + " of " + std::to_string(recording.frames()) + " frames";
}

}  // namespace

void leave_out(const Arguments& arguments, const FileError& error, std::size_t& left_out) {
  if (!arguments.flag("skip-bad"))
    throw std::runtime_error(std::string(error.what()) + " (--skip-bad leaves such files out)");
  arguments.note(std::string("left out: ") + error.what());
  ++left_out;
}

void declare_tables(Arguments& arguments) {
  arguments
      .option("sensor", "FILE",
              "the input is tables of this sensor's frames, a row a frame (*.csv, *.txt, *.tsv, *.npy), or "
              "recordings of supertac-stream (docs/sensors.md)")
      .only_with("sensor")
      .option("columns", "MAP",
              "time=COLUMN:ms,x=COLUMN,y=COLUMN,values=FIRST-LAST; by name or number from 0; without time "
              "rows come at the sensor's rate")
      .option("plate", "NAME",
              "what the passes slide over: a plate's name, or an STL file; where no positions are given they "
              "are found from the signals, for slides towards larger y",
              "unknown")
      .option("positions", "FILE", "table of time, x and y (mm) by the same clock; or a folder of them")
      .option(
          "truth", "FILE",
          "what a finer sensor saw: an array [frames,height,width] (.npy), or a table of a time (s) and the "
          "pixels of an image in a row, whose clock is found from the signals; or a folder of them")
      .option("truth-times", "FILE",
              "of --truth FILE.npy: a table with the time of each image (s), by a clock of its own, which "
              "is found from the signals; or a folder of them")
      .option("truth-range", "LOW,HIGH", "what is 0 and what is 1 in --truth", "0,1")
      .option("group", "GROUP", "person, object or day, for split group; default: the folder's name")
      .only_with("");
}

int import_tables(const Arguments& arguments, const std::string& input) {
  TableImport settings(arguments);
  OutputFolder folder(arguments.output("out"));
  settings.out = folder.path();
  keep_plate_file(arguments.text("plate"), folder.path());
  auto progress = progress_of(arguments, "importing", "files");
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  const std::vector<TableFile> tables = tables_of(input, arguments.text("group"));
  std::size_t left_out = 0;
  for (const TableFile& file : tables) {
    progress(files.size() + left_out, tables.size());
    const std::string path = file.path.string();
    std::size_t dropped = 0;
    std::optional<Registration> fit;
    Recording recording;
    std::string name;
    try {
      recording = settings.import(file, static_cast<int>(files.size()) + 1, dropped, fit);
      name = recording_file_name(recording);
      add_parent_file("table", path);
    } catch (const FileError& error) {
      leave_out(arguments, error, left_out);
      continue;
    } catch (const std::invalid_argument& error) {  // of a table that breaks a rule of recordings
      leave_out(arguments, FileError(path, error.what()), left_out);
      continue;
    }
    write_recording(folder.add(name), recording);
    arguments.print(path + ": " + std::to_string(recording.frames()) + " frames in " +
                    format(recording.time_s.back() - recording.time_s.front(), 2) + " s" +
                    (dropped > 0 ? ", " + std::to_string(dropped) + " lines dropped" : "") + ", " +
                    about_positions(recording, fit));
    files.push_back({{"file", path},
                     {"frames", recording.frames()},
                     {"dropped", dropped},
                     {"positions", !recording.position_mm.empty()},
                     {"truth", !recording.truth.empty()}});
    if (fit) files.back()["reliable"] = fit->reliable, files.back()["residual_mm"] = fit->residual;
  }
  progress = nullptr;
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
