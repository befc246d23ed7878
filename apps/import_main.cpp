// supertac-import: the rig's text recordings as our recordings, each registered against its plate; tables of
// any sensor's frames; pairs of images; or the passes of a collection that was cut off, from its journal.

#include <filesystem>
#include <optional>

#include "apps/collect/passes.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/import/tables.h"
#include "apps/import/text_folder.h"
#include "data/plates/plate.h"
#include "data/recordings/imports/imports.h"
#include "io/files/safetensors.h"

namespace supertac {

void declare(Arguments& arguments) {
  arguments
      .positional(
          "INPUT",
          "folder with <plate>/<trial>/<pass>.txt, 16 voltages of the rig a line; a plate of your own as "
          "<plate>.stl beside its folder. With --sensor: a table, or a folder of them. FILE.safetensors: "
          "frames of any array and what a finer sensor saw of each, input [N,C,H,W], target [N,1,sH,sW] in 0 "
          "to 1, optional group [N]",
          false)
      .option("journal", "FILE", "instead of INPUT: recover a collection that was cut off")
      .required("out", "DIR", "folder for the recordings, one file per pass")
      .writes()
      .option("speed", "MM_PER_S", "sliding speed of the passes in mm/s", "10")
      .flag("skip-bad", "leave out files and folders that are no recordings instead of giving up");
  declare_tables(arguments);
}

namespace {

void refuse_others(const Arguments& arguments, const std::string& reason,
                   const std::vector<std::string>& others) {
  for (const std::string& other : others)
    if (arguments.given(other))
      throw UsageError(reason + ", found with " + (other == "INPUT" ? "" : "--") + other);
}

/// A file of tensors that is no recording; nothing where the input is anything else.
std::optional<SafetensorsFile> pairs_of(const std::string& input) {
  if (!input.ends_with(".safetensors") || !std::filesystem::is_regular_file(input)) return std::nullopt;
  SafetensorsFile file = SafetensorsFile::read(input);
  if (value_or(file.metadata(), "kind") == "recording") return std::nullopt;
  return file;
}

int convert_pairs(const Arguments& arguments, const SafetensorsFile& file) {
  refuse_others(
      arguments, "a file of pairs is converted as it is",
      {"speed", "skip-bad", "columns", "plate", "positions", "truth", "truth-times", "truth-range", "group"});
  std::optional<Sensor> sensor;
  if (arguments.given("sensor")) sensor = read_sensor(arguments.text("sensor"));
  const std::vector<Recording> recordings = import_pairs(file, sensor);
  add_parent_file("pairs", file.path());
  OutputFolder folder(arguments.output("out"));
  std::size_t frames = 0;
  for (const Recording& recording : recordings) {
    stop_if_interrupted();
    frames += recording.frames();
    write_recording(folder.add(recording_file_name(recording)), recording);
  }
  folder.keep();
  arguments.print(std::to_string(recordings.size()) + " recordings of " + std::to_string(frames) +
                  " frames in " + arguments.text("out") + "; train with --preset frame --split " +
                  (recordings.front().metadata.contains("group") ? "group" : "window"));
  arguments.write_json(
      {{"folder", arguments.text("out")}, {"recordings", recordings.size()}, {"frames", frames}});
  return kExitOk;
}

int recover(const Arguments& arguments) {
  refuse_others(arguments, "--journal stands alone with --out", {"INPUT", "speed", "skip-bad", "sensor"});
  OutputFolder folder(arguments.output("out"));
  const PassesReport report = write_passes(arguments, arguments.text("journal"), folder);
  if (report.undated > 0 && report.frames == 0)
    throw FileError(arguments.text("journal"), report.total() + "; keep it, and collect again");
  if (report.frames == 0)
    throw FileError(arguments.text("journal"),
                    "holds no frame of a pass, for it was cut off before the first contact; delete it");
  folder.keep();
  arguments.write_json(report.json);
  arguments.print(report.total(" recovered") + (report.complete ? "" : "; the collection was cut off"));
  return kExitOk;
}

}  // namespace

int run(Arguments& arguments) {
  if (arguments.given("journal")) return recover(arguments);
  if (!arguments.given("INPUT")) throw UsageError("expected INPUT or --journal FILE, found neither");
  const std::string input = arguments.text("INPUT");
  if (const auto pairs = pairs_of(input)) return convert_pairs(arguments, *pairs);
  if (arguments.given("sensor")) return import_tables(arguments, input);
  const std::string out = arguments.text("out");
  OutputFolder folder(arguments.output("out"));
  std::size_t bad = 0, reliable = 0, recordings = 0;
  const FolderImport settings{.speed_mm_s = arguments.number("speed", 0.1, 1000),
                              .left_out = [&](const FileError& error) { leave_out(arguments, error, bad); },
                              .progress = progress_of(arguments, "importing", "files")};
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  const auto keep = [&](const ImportedPass& pass) {
    const std::string name = recording_file_name(pass.recording);
    add_parent_file("text", pass.path);
    write_recording(folder.add(name), pass.recording);
    arguments.print(pass.summary());
    files.push_back(pass.to_json());
    reliable += pass.registration.reliable;
    ++recordings;
  };
  // A plate at a time: no more is in memory, and what is done is on the disk.
  import_text_folder(input, settings, [&](const std::vector<ImportedPass>& plate) {
    for (const ImportedPass& pass : plate) keep(pass);
    keep_plate_file(plate.front().plate_file, folder.path());
  });
  folder.keep();
  arguments.write_json({{"folder", out},
                        {"recordings", recordings},
                        {"reliable", reliable},
                        {"left_out", bad},
                        {"files", files}});
  arguments.print(std::to_string(recordings) + " recordings in " + out + ", " + std::to_string(reliable) +
                  " with a reliable registration");
  return kExitOk;
}

}  // namespace supertac
