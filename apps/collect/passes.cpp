#include "apps/collect/passes.h"

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
Header header_of(const Collection& collection, const std::string& journal) {
  try {
    const auto json = parse_json_limited(collection.header);
    const Header header{json.at("plate").get<std::string>(), json.at("trial").get<int>(),
                        json.at("speed_mm_s").get<double>()};
    plate_in_folder(header.plate, fs::path(journal).parent_path().string());
    if (header.trial >= 1 && header.trial <= 1'000'000 && header.speed > 0 && header.speed < 1e6)
      return header;
  } catch (const FileError&) {
    throw;  // of the plate's file
  } catch (const std::exception& error) {
    throw JournalError(journal + ": its header names no plate, trial and speed (" + error.what() +
                       "); is it a journal of supertac-collect?");
  }
  throw JournalError(journal + ": its header has a trial or speed out of range");
}

/// What is missing from a damaged journal; empty: nothing.
std::string damage_of(const Collection& collection) {
  if (collection.lost_bytes == 0) return {};
  return std::to_string(collection.lost_bytes) + " damaged bytes of the journal, " +
         format(collection.lost_s, 2) + " s, are missing";
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

struct Quality {
  std::size_t frames = 0, suspect = 0;
  double seconds = 0, rate_hz = 0;
};

Quality quality_of(const CollectedPass& pass) {
  Quality quality{.frames = pass.time_s.size(), .seconds = pass.time_s.back() - pass.time_s.front()};
  for (const std::uint8_t flag : pass.suspect) quality.suspect += flag;
  if (quality.seconds > 0) quality.rate_hz = static_cast<double>(quality.frames - 1) / quality.seconds;
  return quality;
}

nlohmann::ordered_json to_json(const CollectedPass& pass, const std::string& file) {
  const Quality quality = quality_of(pass);
  return {{"pass", pass.pass},
          {"file", file},
          {"complete", pass.complete},
          {"seconds", quality.seconds},
          {"frames", quality.frames},
          {"frames_per_s", quality.rate_hz},
          {"missing", pass.missing},
          {"left_out", pass.left_out},
          {"suspect", quality.suspect},
          {"positions", pass.positions},
          {"rejected_positions", pass.rejected_positions},
          {"doubt", pass.doubt}};
}

std::string to_line(const CollectedPass& pass, double speed, double ordered) {
  const Quality quality = quality_of(pass);
  return "pass " + std::to_string(pass.pass) + ": " + std::to_string(quality.frames) + " frames (" +
         format(quality.rate_hz, 1) + "/s), " + std::to_string(pass.missing) + " missing, " +
         (pass.left_out > 0 ? std::to_string(pass.left_out) + " left out of uncertain time, " : "") +
         std::to_string(quality.suspect) + " suspect, " + std::to_string(pass.positions) + " positions" +
         (pass.complete ? "" : ", incomplete") +
         (speed != ordered ? ", at " + format(speed) + " mm/s instead of " + format(ordered) : "") +
         (pass.doubt.empty() ? "" : ", doubtful: " + pass.doubt);
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

PassesReport write_passes(const Arguments& arguments, const std::string& journal, const std::string& out,
                          OutputFolder& folder) {
  const Collection collection = collection_of(read_journal(journal));
  const Header header = header_of(collection, journal);
  PassesReport report{
      .complete = collection.complete, .resets = collection.resets, .damage = damage_of(collection)};
  nlohmann::ordered_json passes = nlohmann::ordered_json::array();
  add_parent_file("journal", journal);
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
    arguments.print(to_line(pass, recording.speed_mm_s, header.speed));
    passes.push_back(to_json(pass, name));
    passes.back()["speed_mm_s"] = recording.speed_mm_s;
    report.frames += pass.time_s.size();
    report.doubtful += pass.doubt.empty() ? 0 : 1;
  }
  if (Plate::is_file(header.plate))
    keep_plate_file((fs::path(journal).parent_path() / header.plate).string(), folder.path());
  const FrameTimeline& clock = collection.clock;
  if (!clock.plausible)
    arguments.note("warning: the board's period is " + format(1e6 * clock.measured_s, 1) + " us, expected " +
                   format(1e6 * rig::kFramePeriodS, 0) + " +- 0.5 %; the nominal one is used");
  report.json = {{"folder", out},
                 {"journal", journal},
                 {"plate", header.plate},
                 {"trial", header.trial},
                 {"speed_mm_s", header.speed},
                 {"complete", collection.complete},
                 {"torn_bytes", collection.torn_bytes},
                 {"lost_bytes", collection.lost_bytes},
                 {"lost_s", collection.lost_s},
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
