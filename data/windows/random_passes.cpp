#include "data/windows/random_passes.h"

#include <algorithm>
#include <cmath>

#include "data/plates/plate.h"
#include "data/simulation/simulator.h"
#include "io/numbers/parallel.h"
#include "io/numbers/random.h"
#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

constexpr double kLeastRateHz = 100;
constexpr std::size_t kPlatesOfASeed = 100'000, kSeeds = 10'000;

// Windows nearer to each other show the same: another plate teaches more.
constexpr double kStrideS = 0.16;

// Half of the slides begin at the plate's edge and half end there, where the finger is half beside it; the
// others up to so far from it: a finger may come down anywhere.
constexpr double kEndMm = 20;
double from_edge_mm(double u) { return std::max(0.0, kEndMm * (2 * u - 1)); }

// How deep the slides lie below first contact with the flat plate. Of the real passes most show the flat
// plate with half the signal of the texture, some with as much.
constexpr double kLeastIndentationMm = -0.5, kMostIndentationMm = 2.2;

// Gains differ from pass to pass by themselves. Other fingers have a mount and a dome from half to twice the
// simulated one's, a pad as narrow as the peaks of real signals show it and by a fifth narrower or wider,
// taxels that feel nothing of a light touch, a tilt as real fingers have it, and they rock on their way. Each
// was chosen on real plates by networks that had seen none (bench/results/unseen_plates.md).
constexpr double kFingerSpread = 0.7, kPadMm = 1.6, kPadSpread = 0.2, kMostThresholdMm = 0.1,
                 kTiltSpread = 0.05, kMostWander = 0.025;
double about(double value, double spread, double u) { return value * same_bits::exp(spread * (2 * u - 1)); }

// The random numbers of a pass.
enum FingerDraw : std::uint64_t { kFrom, kTo, kIndentation, kMount, kDome, kPad, kThreshold, kWander };

SimulatorSettings finger_of(const RandomPasses& passes, const WindowSettings& windows,
                            const RandomStream& random) {
  SimulatorSettings s;
  s.array = windows.array.value_or(TaxelArray{});
  s.body = windows.body.value_or(Body::usual(s.array));
  s.rate_hz = std::max(kLeastRateHz, windows.rate_hz);
  s.filter_s = passes.filter_s;
  // The board's moving average is over ten times as many samples: what it leaves of noise and of the
  // converter's steps.
  s.noise_volts *= std::sqrt(s.rate_hz / rig::kFrameRateHz);
  s.with_adc = false;
  s.indentation_mm = std::lerp(kLeastIndentationMm, kMostIndentationMm, random.uniform(kIndentation));
  if (!passes.other_fingers) return s;
  const double pad_mm = s.body.skin_mm > 0 && s.body != Body::of_rig() ? s.body.skin_mm / 2 : kPadMm;
  s.mount_stiffness = about(s.mount_stiffness, kFingerSpread, random.uniform(kMount));
  s.body.radius_mm = about(s.body.radius_mm, kFingerSpread, random.uniform(kDome));
  s.body.skin_mm = 2 * about(pad_mm, kPadSpread, random.uniform(kPad));
  s.threshold_mm = kMostThresholdMm * random.uniform(kThreshold);
  s.tilt_spread = kTiltSpread;
  s.wander = kMostWander * random.uniform(kWander);
  return s;
}

Recording simulate(std::uint32_t number, const RandomPasses& passes, const WindowSettings& windows) {
  const RandomStream random(number, stream_named("finger"));
  const PassSettings pass{.trial = 1,
                          .pass = 1 + static_cast<int>(number % rig::kPasses),
                          .speed_mm_s = passes.speed_mm_s,
                          .from_mm = from_edge_mm(random.uniform(kFrom)),
                          .to_mm = rig::kPlateLengthMm - from_edge_mm(random.uniform(kTo))};
  Recording recording = simulate_pass(random_plate(number), pass, finger_of(passes, windows, random), number);
  restate(recording, windows.signal_scale.value_or(SignalScale{}));
  return recording;
}

// Each two windows long and good for eight: other levels teach more than the same again.
constexpr std::size_t kFewSilentPasses = 300, kOthersForASilentPass = 80;
constexpr int kWindowsLong = 2, kWindowsOfAPass = 8;
constexpr double kMostNoise = 0.05, kMostDrift = 0.1;

Recording silent_pass(const RandomStream& random, const WindowSettings& windows, bool faint) {
  enum Draw : std::uint64_t { kPressed, kNoise, kDrift, kTaxels = 10, kSamples = 10'000 };
  Recording recording;
  recording.array = windows.array.value_or(TaxelArray{});
  recording.signal_scale = windows.signal_scale.value_or(SignalScale{});
  recording.plate = "plain", recording.trial = recording.pass = 1, recording.source = "simulated";
  const auto frames = static_cast<std::size_t>(kWindowsLong * windows.timesteps);
  const std::size_t signals = recording.array.signals();
  // Squares: a light touch and weak disturbances are what is hard to tell from a texture.
  const auto square = [&](Draw i) { return random.uniform(i) * random.uniform(i); };
  const double pressed = faint ? square(kPressed) * square(kPressed) : square(kPressed);
  const double noise = kMostNoise * square(kNoise), drift = kMostDrift * square(kDrift);
  for (std::size_t t = 0; t < frames; ++t) {
    const double windows_past =
        (static_cast<double>(t) - static_cast<double>(frames) / 2) / windows.timesteps;
    recording.time_s.push_back(static_cast<double>(t) / windows.rate_hz);
    for (std::size_t k = 0; k < signals; ++k) {
      const double slope = drift * (2 * random.uniform(kTaxels + 2 * k + 1) - 1);
      const double x = pressed * random.uniform(kTaxels + 2 * k) + slope * windows_past +
                       noise * random.normal(kSamples + t * signals + k);
      recording.signals.push_back(
          static_cast<float>(windows.scaling.rest - windows.scaling.span * std::clamp(x, 0.0, 1.0)));
    }
    recording.position_mm.push_back(static_cast<float>(rig::kPlateWidthMm / 2));
    recording.position_mm.push_back(static_cast<float>(rig::kPlateLengthMm / 2));
  }
  return recording;
}

}  // namespace

void add_silent_passes(WindowSet& windows, std::uint64_t seed, bool many) {
  const std::size_t tenth = windows.size() / kOthersForASilentPass;
  const std::size_t count = many ? tenth : std::min(kFewSilentPasses, tenth);
  const int stride = std::max(1, windows.settings().timesteps / kWindowsOfAPass);
  for (std::uint64_t i = 0; i < count; ++i) {
    const RandomStream random(seed, stream_named("silent") + i);
    windows.add(silent_pass(random, windows.settings(), i >= kFewSilentPasses), ".",
                {.training_only = true, .augmentable = false, .in_distribution = false, .stride = stride});
  }
}

void add_random_passes(WindowSet& windows, const RandomPasses& passes) {
  constexpr std::size_t kAtOnce = 64;
  const WindowSettings settings = windows.settings();  // of an empty set the first pass would decide the rest
  const int stride = std::max(1, static_cast<int>(kStrideS * settings.rate_hz));
  const std::size_t first_plate = kFirstTrainingPlate + passes.seed % kSeeds * kPlatesOfASeed;
  for (std::size_t first = 0; first < passes.count; first += kAtOnce) {
    std::vector<Recording> recordings(std::min(kAtOnce, passes.count - first));
    parallel_for(recordings.size(), [&](std::size_t i) {
      recordings[i] = simulate(static_cast<std::uint32_t>(first_plate + first + i), passes, settings);
    });
    for (const Recording& recording : recordings)
      windows.add(recording, ".", {.training_only = true, .augmentable = false, .stride = stride});
  }
}

}  // namespace supertac
