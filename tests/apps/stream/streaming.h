// supertac-stream, run on a virtual rig with a model of random weights.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "data/simulation/simulator.h"
#include "io/files/safetensors.h"
#include "models/files/model_file.h"
#include "tests/apps/common/expect.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {

constexpr Dim kTimesteps = 32;
constexpr std::uintmax_t kTwoSeconds = 330'000;  // bytes of a capture

// A model of random weights: what it draws means nothing, but it is the same on every way.
inline void write_model(const std::string& path, Dim timesteps = kTimesteps,
                        std::optional<double> filter_s = 0.0, double delay_s = 0) {
  Rng rng(1);
  const SuperTac model({.timesteps = timesteps, .latent = 3, .scale = 2, .channels = 8, .rcabs = 1}, rng);
  save_model(path, model, {.filter_s = filter_s, .delay_s = delay_s}, {});
}

inline RigSettings touching_rig() {
  RigSettings settings;
  settings.printer_running = true;
  settings.signals = [](double, double, double, double t) {
    std::array<double, 16> volts{};
    for (std::size_t k = 0; k < volts.size(); ++k)
      volts[k] = 2.3 + 0.1 * std::sin(20 * t + static_cast<double>(k));
    return volts;
  };
  return settings;
}

class Streaming : public ProgramTest {
 protected:
  Streaming() { write_model(model()); }

  std::string model() const { return path("model"); }
  std::string board() const { return path("board"); }

  static std::string line(const std::string& more) { return "supertac-stream --model model --quiet " + more; }
  ProcessResult stream(const std::string& more, const ProcessOptions& options = {}) const {
    return run(line(more), options);
  }
  static RunningProcess start(const std::string& more) { return ProgramTest::start(line(more)); }

  // A recording of the simulator up to there, and a model behind its filter.
  Recording record(double to_mm) const {
    const Recording recording = simulate_pass(Plate::named("bumps12"), {.to_mm = to_mm});
    write_recording(path("recording"), recording);
    write_model(model(), kTimesteps, SimulatorSettings().filter_s);
    return recording;
  }
  // Starts the rig; a board that streams before anyone listens is what a program finds.
  FaultyPtyRig& plug_in(const RigSettings& settings = touching_rig()) {
    rig_ = std::make_unique<FaultyPtyRig>(settings, board(), path("printer"));
    return *rig_;
  }
  SafetensorsFile kept(const std::string& name) const { return SafetensorsFile::read(path(name)); }

  std::unique_ptr<FaultyPtyRig> rig_;
};

}  // namespace supertac
