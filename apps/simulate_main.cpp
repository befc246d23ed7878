// supertac-simulate: recordings as the rig or another sensor would make them, without one.

#include <atomic>
#include <filesystem>
#include <functional>

#include "apps/common/command_line/program.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "data/plates/plate.h"
#include "data/recordings/resample.h"
#include "data/simulation/fit.h"
#include "data/simulation/presses.h"
#include "data/simulation/simulator.h"
#include "io/numbers/numbers.h"
#include "io/numbers/parallel.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

/// One recording: what makes it, and its file.
struct Job {
  std::function<Recording()> simulate;
  std::string path;
};

std::vector<Plate> read_plates(const Arguments& arguments) {
  std::vector<Plate> plates;
  for (const std::string& name : arguments.list("plates")) {
    plates.push_back(read_option("plates", [&] { return Plate::named(name); }));
  }
  if (plates.empty()) throw UsageError("--plates: expected at least one plate");
  return plates;
}

SimulatorSettings read_settings(const Arguments& arguments, const Sensor& sensor) {
  SimulatorSettings settings;
  if (arguments.given("sensor")) {
    settings.array = sensor.array;
    settings.rate_hz = sensor.rate_hz;
    settings.body = sensor.body;
    settings.filter_s = 0, settings.with_adc = false;  // the rig's board has these
  }
  return settings;
}

std::string file_of(const std::string& plate, int trial, int pass, double speed_mm_s = 0) {
  Recording named;
  named.plate = plate, named.trial = trial, named.pass = pass, named.speed_mm_s = speed_mm_s;
  return recording_file_name(named);
}

std::vector<Job> plan_passes(const Arguments& arguments, const std::vector<Plate>& plates,
                             const SimulatorSettings& simulator, OutputFolder& folder) {
  std::vector<Job> jobs;
  const std::uint64_t seed = arguments.seed();
  const auto speeds = arguments.numbers("speeds", 0.5, rig::kFastestMmS);
  const int trials = static_cast<int>(arguments.integer("trials", 1, 1000));
  const int passes = static_cast<int>(arguments.integer("passes", 1, rig::kPasses));
  for (const Plate& plate : plates)
    for (const double speed : speeds)
      for (int trial = 1; trial <= trials; ++trial)
        for (int pass = 1; pass <= passes; ++pass) {
          const PassSettings settings{.trial = trial, .pass = pass, .speed_mm_s = speed};
          jobs.push_back({[&plate, settings, &simulator, seed] {
                            return simulate_pass(plate, settings, simulator, seed);
                          },
                          folder.add(file_of(plate.name(), trial, pass, speed))});
        }
  return jobs;
}

std::vector<Job> plan_presses(const Arguments& arguments, const Sensor& sensor, OutputFolder& folder) {
  constexpr int kPressesOfARecording = 125;
  for (const char* other : {"plates", "speeds", "trials", "passes"})
    if (arguments.given(other))
      throw UsageError(std::string("--presses: nothing slides over a plate; leave --") + other + " out");
  const int scale = std::stoi(arguments.choice("scale", {"2", "4", "8", "16"}));
  const std::vector<std::string>& kinds = press_kinds();
  const auto count = static_cast<std::size_t>(arguments.integer("presses", 1, 1'000'000));
  const std::uint64_t seed = arguments.seed();
  std::vector<Job> jobs;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    int left = static_cast<int>((count + kinds.size() - 1 - i) / kinds.size());
    for (Presses presses{.kind = kinds[i], .scale = scale}; left > 0; ++presses.number) {
      presses.count = std::min(left, kPressesOfARecording);
      left -= presses.count;
      jobs.push_back({[&sensor, presses, seed] { return simulate_presses(sensor, presses, seed); },
                      folder.add(file_of(presses.kind, presses.number, 1))});
    }
  }
  return jobs;
}

/// Simulates and writes all recordings, several at a time; each depends on its own settings and the seed
/// only. Returns frames written
std::size_t simulate(const std::vector<Job>& jobs, const Sensor& sensor, FeltTaxels& felt,
                     Progress& progress) {
  std::size_t frames = 0, done = 0;
  std::atomic<bool> failed = false;
  parallel_for(jobs.size(), [&](std::size_t i) {
    if (failed || interrupted()) return;
    try {
      Recording recording = jobs[i].simulate();
      restate(recording, sensor.scale);
      const std::size_t signals = recording.array.signals();
      for (std::size_t f = 0; sensor.array == recording.array && f < recording.frames(); ++f)
        sensor.fill_silent(std::span(recording.signals).subspan(f * signals, signals));
      write_recording(jobs[i].path, recording);
#pragma omp critical
      {
        frames += recording.frames();
        felt.add(recording);
        progress.update(++done);
      }
    } catch (...) {
      failed = true;
      throw;
    }
  });
  stop_if_interrupted();
  return frames;
}

}  // namespace

void declare(Arguments& arguments) {
  arguments.required("out", "DIR", "folder for the recordings")
      .writes()
      .option("plates", "NAME,...",
              "plates of the rig (3_Bumps, ...), plain, kind and pitch in mm (ridges6), or FILE.stl",
              "bumps12,bumps6,bumps4,ridges12,ridges6,ridges4")
      .option("speeds", "MM_PER_S,...", "sliding speeds in mm/s", "5,10")
      .option("trials", "N", "trials of every plate and speed", "2")
      .option("passes", "N", "passes of every trial, 5 mm apart in x (at most 8)", "8")
      .option("sensor", "FILE",
              "a sensor's file: its array, rate, unit, polarity and range instead of the rig's; without the "
              "option: the rig behind its board's filter and ADC; `rig`: before them")
      .option(
          "presses", "N",
          "instead of passes N presses of the sensor: none to four objects at a time that come, move and go, "
          "with the pressure as truth, in groups by kind (" +
              joined(press_kinds(), ", ") + ")")
      .option("fit", "RECORDING",
              "what was recorded of the sensor while somebody pressed here and there for half a minute: what "
              "that tells of noise, rests, skin, response, crosstalk, hysteresis and creep is written into "
              "--sensor FILE first")
      .option("scale", "N", "of --presses: truth N times as fine as the array: 2, 4, 8 or 16", "4")
      .option("seed", "N", "the same seed gives the same files", "1");
}

// What the touches of --fit tell of the sensor, which its file then says.
Sensor fitted(const Arguments& arguments, const Sensor& sensor) {
  const std::string path = arguments.text("sensor"), given = arguments.text("fit");
  if (!arguments.given("sensor") || path == Sensor{}.name)
    throw UsageError("--fit: expected --sensor FILE, the file that is to say what was found");
  const std::string file = std::filesystem::is_directory(given) ? list_recordings(given).back() : given;
  const Recording touches = read_recording(file);
  if (touches.array != sensor.array || touches.signal_scale != sensor.scale)
    throw std::runtime_error(file + ": was not recorded with " + path + ", whose array is " +
                             sensor.array.text() + "; record it again with supertac-stream --sensor " + path +
                             " --record DIR");
  arguments.note("simulating " + std::to_string(BodyFitter::kSimulations) + " bodies");
  const BodyFit fit = BodyFitter(sensor, arguments.seed())(touches);
  for (const std::string& line : fit.lines()) arguments.print(line);
  write_sensor(path, fit.sensor);
  return fit.sensor;
}

int run(Arguments& arguments) {
  const auto plates = read_plates(arguments);
  Sensor sensor;
  if (arguments.given("sensor")) sensor = read_sensor(arguments.text("sensor"));
  if (arguments.given("fit")) sensor = fitted(arguments, sensor);
  const auto settings = read_settings(arguments, sensor);
  if (arguments.list("speeds").empty()) throw UsageError("--speeds: expected at least one speed");
  OutputFolder folder(arguments.output("out"));
  const bool presses = arguments.given("presses");
  const auto jobs =
      presses ? plan_presses(arguments, sensor, folder) : plan_passes(arguments, plates, settings, folder);
  std::size_t frames = 0;
  FeltTaxels felt;
  {
    Progress progress(arguments, "simulating", jobs.size(), "recordings");
    frames = simulate(jobs, sensor, felt, progress);
  }
  if (const std::string found = felt.complaint(); !found.empty()) arguments.note(found);
  for (const std::string& plate : presses ? std::vector<std::string>{} : arguments.list("plates"))
    keep_plate_file(plate, folder.path());
  folder.keep();
  arguments.write_json({{"folder", arguments.text("out")},
                        {"recordings", jobs.size()},
                        {"frames", frames},
                        {"seed", arguments.seed()},
                        {"command", arguments.command_line()}});
  arguments.print(std::to_string(jobs.size()) + " recordings, " + std::to_string(frames) + " frames in " +
                  arguments.text("out"));
  return kExitOk;
}

}  // namespace supertac
