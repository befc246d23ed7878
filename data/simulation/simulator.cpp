#include "data/simulation/simulator.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <stdexcept>

#include "io/numbers/numbers.h"
#include "io/numbers/random.h"

namespace supertac {
namespace {

constexpr double kLiftS = rig::kLiftMm / rig::kLiftMmS;  // of onset and of release

double slide_s(const PassSettings& pass) { return (pass.to_mm - pass.from_mm) / pass.speed_mm_s; }
double return_s(const PassSettings& pass) { return (pass.to_mm - pass.from_mm) / rig::kFastestMmS; }

// The finger's path through the four phases; z_mm is above the slide.
FingerPose pose_at(double t, const PassSettings& pass) {
  const double since_release = t - kLiftS - slide_s(pass);
  const double down = std::clamp(t / kLiftS, 0.0, 1.0),
               slid = std::clamp((t - kLiftS) / slide_s(pass), 0.0, 1.0);
  const double up = std::clamp(since_release / kLiftS, 0.0, 1.0);
  const double back = std::clamp((since_release - kLiftS) / return_s(pass), 0.0, 1.0);
  return {.x_mm = rig::pass_x_mm(pass.pass) + rig::kPassShiftMm * back,
          .y_mm = pass.from_mm + (pass.to_mm - pass.from_mm) * (slid - back),
          .z_mm = rig::kLiftMm * (1 - down + up)};
}

// Smooth noise along the slide: normal numbers `step` apart and smooth steps between them, octave by octave
// half as far and of half the variance.
double rocking(const RandomStream& random, double y_mm) {
  double sum = 0, step = 40, weight = 0.7;  // mm of the widest, and its share
  for (std::uint64_t octave = 0; octave < 6; ++octave, step /= 2, weight *= std::numbers::sqrt2 / 2) {
    const double at = (y_mm + 100) / step, knot = std::floor(at), f = at - knot;
    const std::uint64_t number = 1000 * octave + static_cast<std::uint64_t>(knot);
    sum += weight * std::lerp(random.normal(number), random.normal(number + 1), f * f * (3 - 2 * f));
  }
  return sum;
}

// A finger that is dragged over a plate does not keep its angles, and a printer's path is not level.
class Wander {
 public:
  Wander(double strength, std::uint64_t seed, std::uint64_t stream)
      : strength_(strength),
        across_(seed, stream_named("wander") + stream),
        along_(seed, stream_named("wander") + stream + 1),
        height_(seed, stream_named("wander") + stream + 2) {}
  void apply(FingerPose& pose) const {
    if (strength_ <= 0) return;
    pose.slope_x += strength_ * rocking(across_, pose.y_mm);
    pose.slope_y += strength_ * rocking(along_, pose.y_mm);
    pose.z_mm += 4 * strength_ * rocking(height_, pose.y_mm);
  }

 private:
  double strength_;
  RandomStream across_, along_, height_;
};

void check(const PassSettings& pass, const SimulatorSettings& settings) {
  const auto positive = [](double v) { return std::isfinite(v) && v > 0; };
  if (!positive(pass.speed_mm_s) || !positive(settings.rate_hz) || !(pass.to_mm > pass.from_mm) ||
      !(pass.from_mm >= 0) || !(pass.to_mm <= rig::kPlateLengthMm))
    throw std::invalid_argument(
        "simulate_pass: speed and rate must be positive and the slide lie on the plate (0.." +
        format(rig::kPlateLengthMm) + " mm); got speed " + format(pass.speed_mm_s) + " mm/s, rate " +
        format(settings.rate_hz) + " Hz, slide from " + format(pass.from_mm) + " to " + format(pass.to_mm) +
        " mm");
  if (pass.pass < 1 || pass.pass > rig::kPasses || pass.trial < 1)
    throw std::invalid_argument("simulate_pass: expected pass 1.." + std::to_string(rig::kPasses) +
                                " and trial >= 1, got pass " + std::to_string(pass.pass) + ", trial " +
                                std::to_string(pass.trial));
}

// Moving average over the last `length` samples, or as many as there are.
class MovingAverage {
 public:
  explicit MovingAverage(int length) : length_(static_cast<std::size_t>(std::max(1, length))) {}
  std::vector<double> operator()(const std::vector<double>& sample) {
    recent_.push_back(sample);
    if (recent_.size() > length_) recent_.pop_front();
    std::vector<double> mean(sample.size());
    for (const auto& s : recent_)
      for (std::size_t k = 0; k < s.size(); ++k) mean[k] += s[k];
    for (double& m : mean) m /= static_cast<double>(recent_.size());
    return mean;
  }

 private:
  std::size_t length_;
  std::deque<std::vector<double>> recent_;
};

Recording describe(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings,
                   std::uint64_t seed) {
  Recording recording;
  recording.array = settings.array;
  recording.body = settings.body;
  recording.plate = plate.name();
  recording.trial = pass.trial;
  recording.pass = pass.pass;
  recording.speed_mm_s = pass.speed_mm_s;
  recording.source = "simulated";
  recording.metadata["seed"] = std::to_string(seed);
  recording.metadata["rate_hz"] = format(settings.rate_hz);
  recording.metadata["filter_s"] = format(settings.filter_s);
  return recording;
}

}  // namespace

Recording simulate_pass(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings,
                        std::uint64_t seed) {
  check(pass, settings);
  const FingerModel finger(
      plate, settings, {.seed = seed, .trial = pass.trial, .pass = pass.pass, .speed_mm_s = pass.speed_mm_s});
  const double duration = 2 * kLiftS + slide_s(pass) + return_s(pass);
  const auto frames = static_cast<std::size_t>(std::floor(duration * settings.rate_hz + 0.5));
  // Timing faults have a stream of their own for each pass, so that a loss in one pass does not move
  // another's.
  const RandomStream timing(seed, stream_named("time") + finger.noise_stream());
  const Wander wander(settings.wander, seed, finger.noise_stream());
  MovingAverage filter(static_cast<int>(std::lround(settings.filter_s * settings.rate_hz)));

  BodyResponse response(settings.body, settings.array);

  Recording recording = describe(plate, pass, settings, seed);
  for (std::size_t i = 0; i < frames; ++i) {
    const double stamp = static_cast<double>(i) / settings.rate_hz;
    const double taken = stamp + settings.jitter_s * timing.normal(2 * i);
    FingerPose felt = pose_at(taken, pass);
    felt.z_mm += finger.slide_z_mm();
    wander.apply(felt);
    std::vector<double> volts = finger.volts(felt, taken);
    if (settings.with_adc)
      for (double& v : volts) v = rig::volts_of(rig::adc_of(v));
    if (!response.neutral()) {
      for (double& v : volts) v = (recording.signal_scale.rest - v) / recording.signal_scale.span;
      response(1 / settings.rate_hz, volts);
      for (double& v : volts) v = recording.signal_scale.rest - recording.signal_scale.span * v;
    }
    volts = filter(volts);
    if (timing.uniform(2 * i + 1) < settings.lost_fraction) continue;
    const FingerPose pose = pose_at(stamp, pass);
    recording.time_s.push_back(stamp);
    for (const double v : volts)
      recording.signals.push_back(static_cast<float>(
          settings.with_saturation ? std::clamp(v, rig::kFloorVolts, rig::kCeilingVolts) : v));
    recording.position_mm.push_back(static_cast<float>(pose.x_mm));
    recording.position_mm.push_back(static_cast<float>(pose.y_mm));
    recording.lift_mm.push_back(static_cast<float>(pose.z_mm));
  }
  return recording;
}

}  // namespace supertac
