// supertac-import: the rig's text recordings as our recordings, each registered against its plate; or those
// of a collection that was cut off, from its journal.

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "apps/collect/passes.h"
#include "apps/common/output_folder.h"
#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "data/plates/plate_file.h"
#include "data/recordings/text_import.h"
#include "data/registration/alignment.h"
#include "data/registration/lost_frames.h"
#include "data/registration/registration.h"
#include "data/registration/registration_picture.h"
#include "io/file.h"
#include "io/numbers.h"
#include "io/text.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

struct TextPass {
  std::string path;
  Plate plate;
  int trial, pass;
};

struct Imported {
  const TextPass* pass = nullptr;
  Recording recording;
  ImportReport report;
  Registration registration;
};

void declare(Arguments& arguments) {
  arguments
      .positional(
          "TEXT_DIR",
          "folder with <plate>/<trial>/<pass>.txt, 16 voltages a line; a plate of your own as <plate>.stl "
          "beside its folder",
          false)
      .option("journal", "FILE", "instead of TEXT_DIR: recover a collection that was cut off")
      .required("out", "DIR", "folder for the recordings, one file per pass")
      .option("speed", "MM_PER_S", "sliding speed of the passes in mm/s", "10")
      .option("pictures", "DIR", "write a PNG of each pass: its signals under the plate they were fitted to",
              "")
      .flag("skip-bad", "leave out files that are no recordings instead of giving up");
}

/// Entries of a folder by name, hidden ones left out.
std::vector<fs::path> entries_of(const fs::path& folder, bool folders) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const bool hidden = entry->path().filename().string().starts_with(".");
    if (!hidden && entry->is_directory() == folders) entries.push_back(entry->path());
  }
  if (error)
    throw FileError(folder.string(), "cannot list the folder: " + error.message() + "; check the name");
  std::sort(entries.begin(), entries.end());
  return entries;
}

int number_of(const fs::path& path, const std::string& name) {
  const auto number = parse_int(name);
  if (number && *number >= 1 && *number <= 1'000'000) return static_cast<int>(*number);
  throw FileError(path.string(), "expected a number from 1 as its name: TEXT_DIR/<plate>/<trial>/<pass>.txt");
}

/// The STL file that describes a folder's plate, <plate>.stl beside it; empty when there is none.
std::string plate_file_of(const fs::path& folder) {
  const std::string file = folder.string() + ".stl";
  return fs::exists(file) ? file : "";
}

Plate plate_of(const fs::path& folder) {
  const std::string file = plate_file_of(folder);
  try {
    return Plate::named(file.empty() ? folder.filename().string() : file);
  } catch (const std::invalid_argument& error) {
    throw FileError(folder.string(), std::string("unknown plate: ") + error.what());
  }
}

std::vector<TextPass> find_passes(const std::string& root) {
  std::vector<TextPass> passes;
  for (const fs::path& folder : entries_of(root, true)) {
    const Plate plate = plate_of(folder);
    for (const fs::path& trial : entries_of(folder, true)) {
      const int trial_number = number_of(trial, trial.filename().string());
      for (const fs::path& pass : entries_of(trial, false)) {
        if (pass.extension() != ".txt") continue;
        passes.push_back({pass.string(), plate, trial_number, number_of(pass, pass.stem().string())});
      }
    }
  }
  if (passes.empty())
    throw FileError(root, "holds no <plate>/<trial>/<pass>.txt; name the folder above the plates");
  return passes;
}

Imported import_pass(const TextPass& pass, double speed_mm_s) {
  Imported imported;
  imported.pass = &pass;
  Recording& recording = imported.recording;
  recording = import_text_pass(pass.path, imported.report);
  recording.plate = pass.plate.name();
  recording.trial = pass.trial;
  recording.pass = pass.pass;
  recording.speed_mm_s = speed_mm_s;
  restore_clock(recording, rig::kFrameRateHz);
  imported.registration = register_pass(recording, pass.plate);
  return imported;
}

nlohmann::ordered_json to_json(const Imported& imported) {
  const TextPass& pass = *imported.pass;
  const ImportReport& report = imported.report;
  const Registration& registration = imported.registration;
  return {{"file", pass.path},
          {"plate", pass.plate.name()},
          {"trial", pass.trial},
          {"pass", pass.pass},
          {"lines", report.lines},
          {"frames", report.frames},
          {"malformed", report.malformed()},
          {"too_few_columns", report.too_few},
          {"too_many_columns", report.too_many},
          {"not_numeric", report.not_numeric},
          {"non_finite", report.non_finite},
          {"out_of_range", report.out_of_range},
          {"registration",
           {{"start_mm", registration.start_mm},
            {"rate_mm_s", registration.rate},
            {"residual_mm", registration.residual},
            {"contacts", registration.contacts},
            {"elements", registration.elements},
            {"matched", registration.matched},
            {"coverage", registration.coverage},
            {"margin", registration.margin},
            {"shift_mm", registration.shift_mm},
            {"stretch_mm", registration.stretch_mm},
            {"lost_at_s", registration.lost_at_s},
            {"lost_s", registration.lost_s},
            {"agreement", registration.agreement},
            {"reliable", registration.reliable},
            {"reason", registration.reason}}}};
}

std::string to_line(const Imported& imported) {
  const TextPass& pass = *imported.pass;
  const ImportReport& report = imported.report;
  const Registration& registration = imported.registration;
  const std::size_t dropped = report.lines - report.empty - report.frames;
  std::string line = pass.plate.name() + "/" + std::to_string(pass.trial) + "/" + std::to_string(pass.pass) +
                     ".txt  " + std::to_string(report.lines) + " lines, " + std::to_string(dropped) +
                     " dropped (" + std::to_string(report.malformed()) + " malformed), residual " +
                     format(registration.residual, 2) + " mm, ";
  if (registration.agreement > 0) line += "aligned by " + format(registration.shift_mm, 2) + " mm, ";
  if (registration.lost_s > 0) line += "another " + format(registration.lost_s, 2) + " s lost, ";
  return line + (registration.reliable ? "reliable" : "not reliable: " + registration.reason);
}

/// What is wrong with a file is said and counted in `bad`; without --skip-bad the first such file ends the
/// import.
std::vector<Imported> import_all(const Arguments& arguments, const std::vector<TextPass>& passes,
                                 std::size_t& bad) {
  std::vector<Imported> all;
  Progress progress(arguments, "importing", passes.size(), "files");
  const double speed = arguments.number("speed", 0.1, 1000);
  for (std::size_t i = 0; i < passes.size(); ++i) {
    stop_if_interrupted();
    try {
      all.push_back(import_pass(passes[i], speed));
    } catch (const FileError& error) {
      if (!arguments.flag("skip-bad")) {
        throw std::runtime_error(std::string(error.what()) + " (--skip-bad leaves such files out)");
      }
      arguments.note(std::string("left out: ") + error.what());
      ++bad;
    }
    progress.update(i + 1);
  }
  return all;
}

/// The passes of each plate that feels the same along every line.
void align_plates(std::vector<Imported>& all) {
  std::map<std::string, std::vector<RegisteredPass>> plates;
  for (Imported& imported : all)
    if (imported.pass->plate.uniform_in_x())
      plates[imported.pass->plate.name()].push_back({&imported.recording, &imported.registration});
  for (const auto& [plate, passes] : plates) {
    stop_if_interrupted();
    align_passes(passes);
  }
}

void write(Imported& imported, OutputFolder& folder, OutputFolder* pictures) {
  apply(imported.registration, imported.recording);
  const std::string name = recording_file_name(imported.recording);
  write_recording(folder.add(name), imported.recording);
  if (pictures != nullptr)
    write_png(pictures->add(fs::path(name).stem().string() + ".png"),
              registration_picture(imported.recording, imported.pass->plate));
}

int recover(const Arguments& arguments) {
  for (const char* other : {"TEXT_DIR", "speed", "skip-bad", "pictures"})
    if (arguments.given(other))
      throw UsageError(std::string("--journal: stands alone with --out, found with ") + other);
  const std::string out = arguments.text("out");
  OutputFolder folder(out, arguments.force());
  const PassesReport report = write_passes(arguments, arguments.text("journal"), out, folder);
  if (report.frames == 0)
    throw FileError(arguments.text("journal"),
                    "holds no frame of a pass: it was cut off before the first contact");
  arguments.write_json(report.json);
  folder.keep();
  arguments.print(std::to_string(report.frames) + " frames recovered" +
                  (report.complete ? "" : "; the collection was cut off"));
  return kExitOk;
}

int run(Arguments& arguments) {
  if (arguments.given("journal")) return recover(arguments);
  if (!arguments.given("TEXT_DIR")) throw UsageError("expected TEXT_DIR or --journal FILE, found neither");
  arguments.number("speed", 0.1, 1000);
  const auto passes = find_passes(arguments.text("TEXT_DIR"));
  OutputFolder folder(arguments.text("out"), arguments.force());
  std::optional<OutputFolder> pictures;
  if (arguments.given("pictures")) pictures.emplace(arguments.text("pictures"), arguments.force());
  std::size_t bad = 0, reliable = 0;
  std::vector<Imported> all = import_all(arguments, passes, bad);
  if (all.empty()) {
    throw FileError(arguments.text("TEXT_DIR"), "none of " + std::to_string(bad) + " files is a recording");
  }
  align_plates(all);
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (Imported& imported : all) {
    write(imported, folder, pictures ? &*pictures : nullptr);
    arguments.print(to_line(imported));
    files.push_back(to_json(imported));
    reliable += imported.registration.reliable;
  }
  arguments.write_json({{"folder", arguments.text("out")},
                        {"recordings", all.size()},
                        {"reliable", reliable},
                        {"left_out", bad},
                        {"files", files}});
  for (const auto& plate : entries_of(arguments.text("TEXT_DIR"), true))
    keep_plate_file(plate_file_of(plate), arguments.text("out"));
  folder.keep();
  if (pictures) pictures->keep();
  arguments.print(std::to_string(all.size()) + " recordings in " + arguments.text("out") + ", " +
                  std::to_string(reliable) + " with a reliable registration");
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  return run_program(
      {"supertac-import",
       "Imports the rig's text recordings, drops malformed lines, fits every pass to its plate.", declare,
       run},
      argc, argv);
}
