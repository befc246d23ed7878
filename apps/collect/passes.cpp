#include "apps/collect/passes.h"

#include <nlohmann/json.hpp>

#include "data/recording.h"
#include "hardware/errors.h"
#include "io/file.h"
#include "io/json.h"
#include "io/numbers.h"

namespace supertac {
namespace {

// The plate's corner in the printer's coordinates: pass 1 at X99.70 runs 0.5 mm inside the plate's edge.
constexpr double kPlateX = 99.2, kPlateY = 101.17;

Recording recording_of(const CollectedPass& pass, const nlohmann::ordered_json& header) {
  Recording recording;
  recording.time_s = pass.time_s;
  recording.volts = pass.volts;
  for (size_t i = 0; i < pass.time_s.size(); ++i) {
    recording.position_mm.push_back(static_cast<float>(pass.position[3 * i] - kPlateX));
    recording.position_mm.push_back(static_cast<float>(pass.position[3 * i + 1] - kPlateY));
  }
  recording.plate = header.at("plate").get<std::string>();
  recording.trial = header.at("trial").get<int>();
  recording.pass = pass.pass;
  recording.speed_mm_s = header.at("speed_mm_s").get<double>();
  recording.source = "collected";
  recording.metadata = {{"complete", pass.complete ? "true" : "false"},
                        {"missing_frames", std::to_string(pass.missing)},
                        {"time_base", pass.positions > 0 ? "M114 R" : "modelled motion"}};
  return recording;
}

std::string quality_line(const CollectedPass& pass) {
  size_t suspect = 0;
  for (const uint8_t flag : pass.suspect) suspect += flag;
  const double seconds = pass.time_s.back() - pass.time_s.front();
  const auto frames = static_cast<double>(pass.time_s.size());
  return "pass " + std::to_string(pass.pass) + ": " + std::to_string(pass.time_s.size()) + " frames (" +
         format(seconds > 0 ? (frames - 1) / seconds : 0, 1) + "/s), " + std::to_string(pass.missing) +
         " missing, " + std::to_string(suspect) + " suspect, " + std::to_string(pass.positions) +
         " positions" + (pass.complete ? "" : ", incomplete");
}

}  // namespace

std::string collection_header(const std::string& plate, int trial, double speed) {
  const nlohmann::ordered_json header{
      {"version", 1}, {"plate", plate}, {"trial", trial}, {"speed_mm_s", speed}};
  return header.dump();
}

std::string journal_path(const std::string& folder, const std::string& plate, int trial, double speed) {
  return folder + "/" + plate + "_t" + std::to_string(trial) + "_v" + format(speed) + ".journal";
}

int write_passes(const Arguments& arguments, const std::string& journal, const std::string& folder) {
  const Collection collection = collection_of(read_journal(journal));
  const nlohmann::ordered_json header = parse_json_limited(collection.header);
  int frames = 0;
  for (const CollectedPass& pass : collection.passes) {
    if (pass.time_s.size() < 2) continue;
    const Recording recording = recording_of(pass, header);
    const std::string path = folder + "/" + recording_file_name(recording);
    refuse_existing(path, arguments.force());
    write_recording(path, recording);
    arguments.note(quality_line(pass));
    frames += static_cast<int>(pass.time_s.size());
  }
  if (!collection.clock.plausible) {
    arguments.note("warning: the board's period is " + format(1e6 * collection.clock.period_s, 1) +
                   " us, expected 992 +- 0.5 %");
  }
  return frames;
}

}  // namespace supertac
