#include "apps/collect/passes.h"

#include <algorithm>
#include <filesystem>

#include "apps/common/output/provenance.h"
#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "hardware/ports/errors.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

struct Header {
  std::string plate;
  int trial = 0;
  double speed = 0;
};

// The header as collection_header() writes it; the plate must be known, since it becomes a file's name.
Header header_of(const Journal& journal, const std::string& path) {
  try {
    const auto json = parse_json_limited(journal.header);
    const Header header{json.at("plate").get<std::string>(), json.at("trial").get<int>(),
                        json.at("speed_mm_s").get<double>()};
    plate_in_folder(header.plate, fs::path(path).parent_path().string());
    if (header.trial >= 1 && header.trial <= 1'000'000 && header.speed > 0 && header.speed < 1e6)
      return header;
  } catch (const FileError&) {
    throw;  // of the plate's file
  } catch (const std::exception& error) {
    throw JournalError(path + ": its header names no plate, trial and speed (" + error.what() +
                       "); is it a journal of supertac-collect?");
  }
  throw JournalError(path + ": its header has a trial or speed out of range");
}

Recording recording_of(const CollectedPass& pass, const Collection& collection, const Header& header,
                       const std::string& damage) {
  const Point3& plate = collection.bed.limits.plate;
  Recording recording;
  recording.array = collection.sensor.array;
  recording.signal_scale = collection.sensor.scale;
  recording.body = collection.sensor.body;
  recording.time_s = pass.time_s;
  recording.signals = pass.signals;
  for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
    recording.position_mm.push_back(static_cast<float>(pass.position[3 * i] - plate.x));
    recording.position_mm.push_back(static_cast<float>(pass.position[3 * i + 1] - plate.y));
    recording.lift_mm.push_back(static_cast<float>(pass.position[3 * i + 2] - plate.z));
  }
  recording.plate = header.plate;
  recording.trial = header.trial;
  recording.pass = pass.pass;
  recording.speed_mm_s = header.speed;
  recording.source = "collected";
  recording.metadata = {{"complete", pass.complete ? "true" : "false"},
                        {"missing_frames", std::to_string(pass.missing)},
                        {"time_base", pass.positions > 0 ? "M114 R" : "modelled motion"}};
  if (const std::vector<int> silent = collection.sensor.silent(); !silent.empty())
    recording.metadata["silent_taxels"] = nlohmann::json(silent).dump();
  if (pass.left_out > 0) recording.metadata["left_out_frames"] = std::to_string(pass.left_out);
  if (!damage.empty()) recording.metadata["damage"] = damage;
  if (!pass.doubt.empty()) recording.metadata["doubt"] = pass.doubt;
  return recording;
}

/// Says how good the pass in `file` is, as a line; the same for --json.
nlohmann::ordered_json report_on(const CollectedPass& pass, const std::string& file, double speed,
                                 double ordered, const Arguments& arguments) {
  const std::size_t frames = pass.time_s.size();
  const double seconds = pass.time_s.back() - pass.time_s.front();
  const double rate_hz = seconds > 0 ? static_cast<double>(frames - 1) / seconds : 0;
  const auto suspect = std::ranges::count(pass.suspect, 1);
  arguments.print("pass " + std::to_string(pass.pass) + ": " + std::to_string(frames) + " frames (" +
                  format(rate_hz, 1) + "/s), " + std::to_string(pass.missing) + " missing, " +
                  (pass.left_out > 0 ? std::to_string(pass.left_out) + " left out of uncertain time, " : "") +
                  std::to_string(suspect) + " suspect, " + std::to_string(pass.positions) + " positions" +
                  (pass.complete ? "" : ", incomplete") +
                  (speed != ordered ? ", at " + format(speed) + " mm/s instead of " + format(ordered) : "") +
                  (pass.doubt.empty() ? "" : ", doubtful: " + pass.doubt));
  return {{"pass", pass.pass},
          {"file", file},
          {"complete", pass.complete},
          {"seconds", seconds},
          {"frames", frames},
          {"frames_per_s", rate_hz},
          {"missing", pass.missing},
          {"left_out", pass.left_out},
          {"suspect", suspect},
          {"positions", pass.positions},
          {"rejected_positions", pass.rejected_positions},
          {"doubt", pass.doubt},
          {"speed_mm_s", speed}};
}

}  // namespace

std::string collection_header(const std::string& plate, int trial, double speed, const Sensor& sensor,
                              const Bed& bed) {
  nlohmann::ordered_json header{{"version", 1}, {"plate", plate}, {"trial", trial}, {"speed_mm_s", speed}};
  if (sensor != Sensor{}) header["sensor"] = json_of(sensor);
  if (bed != Bed{}) header["bed"] = json_of(bed);
  return header.dump();
}

std::string journal_path(const std::string& folder, const std::string& plate, int trial, double speed) {
  return folder + "/" + plate + "_t" + std::to_string(trial) + "_v" + format(speed) + ".journal";
}

std::string PassesReport::total(const std::string& became) const {
  return std::to_string(frames) + " frames" + became +
         (left_out > 0 ? ", " + std::to_string(left_out) + " left out, their time being uncertain" : "") +
         (undated > 0 ? ", " + std::to_string(undated) + " passes without a recording, no frame being dated"
                      : "") +
         (doubtful > 0 ? ", " + std::to_string(doubtful) + " passes with doubtful positions" : "") +
         (resets > 0 ? ", the sensor started anew " + std::to_string(resets) + " times" : "") +
         (damage.empty() ? "" : "; " + damage);
}

PassesReport write_passes(const Arguments& arguments, const std::string& path, OutputFolder& folder) {
  const Journal journal = read_journal(path);
  const Collection collection = collection_of(journal);
  const Header header = header_of(journal, path);
  PassesReport report{.complete = collection.complete, .resets = collection.clock.resets};
  if (journal.lost_bytes > 0)
    report.damage = std::to_string(journal.lost_bytes) + " damaged bytes of the journal, " +
                    format(journal.lost_s, 2) + " s, are missing";
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  add_parent_file("journal", path);
  for (const CollectedPass& pass : collection.passes) {
    report.left_out += pass.left_out;
    if (pass.time_s.size() < 2) {
      report.undated += pass.left_out > 0 ? 1 : 0;
      continue;
    }
    Recording recording = recording_of(pass, collection, header, report.damage);
    const std::string name = recording_file_name(recording);  // a trial's files are known by its order
    recording.speed_mm_s = named_speed(pass.measured_speed, header.speed);
    if (recording.speed_mm_s != header.speed) recording.metadata["ordered_mm_s"] = format(header.speed);
    write_recording(folder.add(name), recording);
    passes.push_back(report_on(pass, name, recording.speed_mm_s, header.speed, arguments));
    report.frames += pass.time_s.size();
    report.doubtful += pass.doubt.empty() ? 0 : 1;
  }
  if (Plate::is_file(header.plate))
    keep_plate_file((fs::path(path).parent_path() / header.plate).string(), folder.path());
  const FrameTimeline& clock = collection.clock;
  if (!clock.plausible)
    arguments.note("warning: frames came every " + format(1e6 * clock.measured_s, 1) + " us, expected " +
                   format(1e6 * clock.period_s, 1) + " us; the stated period is used");
  report.json = {{"folder", arguments.text("out")},
                 {"journal", path},
                 {"plate", header.plate},
                 {"trial", header.trial},
                 {"speed_mm_s", header.speed},
                 {"complete", collection.complete},
                 {"torn_bytes", journal.torn_bytes},
                 {"lost_bytes", journal.lost_bytes},
                 {"lost_s", journal.lost_s},
                 {"board_period_us", 1e6 * clock.measured_s},
                 {"board_period_plausible", clock.plausible},
                 {"frames", report.frames},
                 {"left_out", report.left_out},
                 {"undated_passes", report.undated},
                 {"device_resets", report.resets},
                 {"doubtful_passes", report.doubtful},
                 {"passes", passes}};
  return report;
}

}  // namespace supertac
