#include "data/simulation/presses.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/simulation/simulator.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kStepS = 0.05;                      // of what remembers: hysteresis and creep
constexpr double kLeastSkin = 0.3, kMostSkin = 1.2;  // in pitches, where nobody knows
constexpr double kLeastNoise = 0.002, kMostNoise = 0.01;
constexpr double kStrength = 0.25, kTaxelSpread = 0.05;
constexpr double kGive = 0.25;  // of the skin: how far a hard press goes into it
constexpr double kMarginSigmas = 2.5;
constexpr double kNarrowest = 0.25;  // of a cell: a bell that is narrower would fall between cells

enum PressDraw : std::uint64_t { kSkin, kNoise, kOfStrength, kTimes = 10, kFit = 100, kTaxels = 1000 };
constexpr std::uint64_t kSamples = 1'000'000;

// What is known of the body, as far as it is known.
Body drawn(Body body, const TaxelArray& array, const RandomStream& random) {
  const double pitch = std::sqrt(array.pitch_mm.x * array.pitch_mm.y);
  std::uint64_t number = kFit;
  for (const auto& [key, of] : fitted_numbers()) {
    ++number;
    const auto found = body.uncertainty.find(key);
    if (found == body.uncertainty.end() || found->second <= 0) continue;
    double& value = body.*of;
    value = std::max(value / 4, value + found->second * random.normal(number));
  }
  if (body.skin_mm == 0) body.skin_mm = pitch * std::lerp(kLeastSkin, kMostSkin, random.uniform(kSkin));
  if (body.noise == 0) body.noise = std::lerp(kLeastNoise, kMostNoise, random.uniform(kNoise));
  return body;
}

// Of the cells of a field, as the skin's bell is felt over a taxel's side.
TaxelWeights weights_of(int lines, double pitch, int cells, double first, double step, const Body& body) {
  const double skin = std::max(body.skin_mm / 2, kNarrowest * step);
  return {lines, pitch, cells, first, step, skin, std::max(body.sigma_mm(), skin), body.taxel_mm};
}

// The truth's pixels, and as many around them as a taxel at the edge feels.
Field field_of(const TaxelArray& array, int scale, double sigma_mm) {
  const double pixel_x = array.pitch_mm.x / scale, pixel_y = array.pitch_mm.y / scale;
  const auto beyond = [&](double pixel) {
    return static_cast<int>(std::ceil(kMarginSigmas * sigma_mm / pixel));
  };
  const int rows = array.rows * scale + 2 * beyond(pixel_y),
            columns = array.columns * scale + 2 * beyond(pixel_x);
  return {-(columns - 1) / 2.0 * pixel_x, -(rows - 1) / 2.0 * pixel_y, pixel_x, pixel_y, rows, columns};
}

// One press of one drawn body.
class Press {
 public:
  // The scene goes `pace` times as fast as usually.
  Press(const Sensor& sensor, const Scene::Objects& objects, int scale, const RandomStream& random,
        const RandomStream& of_scene, double pace = 1)
      : sensor_(sensor),
        body_(drawn(sensor.body, sensor.array, random)),
        random_(random),
        scene_(objects, sensor.array, of_scene),
        field_(field_of(sensor.array, scale, body_.sigma_mm())),
        across_(weights_of(sensor.array.columns, sensor.array.pitch_mm.x, field_.columns, field_.left_mm,
                           field_.cell_x_mm, body_)),
        along_(weights_of(sensor.array.rows, sensor.array.pitch_mm.y, field_.rows, field_.top_mm,
                          field_.cell_y_mm, body_)),
        response_(body_, sensor.array),
        strength_(1 + kStrength * (2 * random.uniform(kOfStrength) - 1)),
        pace_(pace),
        pressure_(field_.cells()) {}

  // Times within the press are asked for in ascending order; the signals and the truth (scale 0: none) are
  // appended.
  void frame(double t, int scale, Recording& recording) {
    while (!response_.neutral() && before_ + kStepS < t) show(before_ + kStepS);
    std::vector<double> shares = show(t);
    const auto channels = static_cast<std::size_t>(sensor_.array.channels);
    const std::size_t from = recording.signals.size();
    for (std::size_t s = 0; s < shares.size(); ++s) {
      const double lean_rest = channels == 3 && s % 3 < 2 && sensor_.rest.empty() ? 0.5 : 0;
      const double noisy = shares[s] + lean_rest + body_.noise * random_.normal(kSamples + samples_++);
      recording.signals.push_back(static_cast<float>(
          sensor_.scale.rest - sensor_.scale.span * std::clamp(noisy, -4 * body_.noise, 1.0)));
    }
    sensor_.fill_silent(std::span(recording.signals).subspan(from));
    if (scale == 0) return;
    const int rows = sensor_.array.rows * scale, columns = sensor_.array.columns * scale;
    const int above = (field_.rows - rows) / 2, beside = (field_.columns - columns) / 2;
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c)
        recording.truth.push_back(static_cast<float>(
            std::min(1.0, pressure_[static_cast<std::size_t>((r + above) * field_.columns + c + beside)])));
  }

 private:
  std::vector<double> show(double t) {
    scene_.pressure(t * pace_, body_, kGive * body_.skin_mm, field_, pressure_);
    const auto taxels = static_cast<std::size_t>(sensor_.array.taxels()),
               channels = static_cast<std::size_t>(sensor_.array.channels);
    std::vector<double> shares(taxels * channels);
    for (std::size_t channel = 0; channel < channels; ++channel) {
      const std::vector<double> load =
          taxel_loads(sensor_.array, pressure_, 1, static_cast<std::size_t>(field_.columns),
                      channels == 3 && channel == 0 ? across_.lean : across_.load,
                      channels == 3 && channel == 1 ? along_.lean : along_.load);
      for (std::size_t k = 0; k < taxels; ++k)
        shares[k * channels + channel] =
            load[k] * strength_ * (1 + kTaxelSpread * random_.normal(kTaxels + k));
    }
    response_(t - before_, shares);
    before_ = t;
    return shares;
  }

  const Sensor& sensor_;
  Body body_;
  RandomStream random_;
  Scene scene_;
  Field field_;
  TaxelWeights across_, along_;
  BodyResponse response_;
  double strength_, pace_, before_ = 0;
  std::uint64_t samples_ = 0;
  std::vector<double> pressure_;
};

}  // namespace

Recording simulate_presses(const Sensor& sensor, const Presses& presses, std::uint64_t seed) {
  const int scale = presses.scale;
  if (sensor.array.channels != 1 && sensor.array.channels != 3)
    throw std::invalid_argument(
        refusal("presses", "array", "one channel or three axes", sensor.array.text()));
  Recording recording;
  recording.array = sensor.array, recording.body = sensor.body, recording.signal_scale = sensor.scale;
  recording.plate = recording.metadata["group"] = presses.kind;
  recording.trial = presses.number, recording.pass = 1, recording.source = "simulated";
  recording.metadata["seed"] = std::to_string(seed);
  recording.truth_height = sensor.array.rows * scale, recording.truth_width = sensor.array.columns * scale;
  for (int i = 0; i < presses.count; ++i) {
    const std::uint64_t stream = stream_hashed("press/" + presses.kind + "/" +
                                               std::to_string(presses.number) + "/" + std::to_string(i));
    const RandomStream random(seed, stream);
    Press press(sensor, {presses.kind}, scale, random, RandomStream(seed, stream + 1));
    for (std::uint64_t f = 0; f < kFramesOfAPress; ++f) {
      const double t = Scene::kSeconds * (static_cast<double>(f) + 0.1 + 0.9 * random.uniform(kTimes + f)) /
                       kFramesOfAPress;
      recording.time_s.push_back(i * Scene::kSeconds + t);
      press.frame(t, scale, recording);
    }
  }
  return recording;
}

Recording simulate_touching(const Sensor& sensor, double seconds, std::uint64_t seed) {
  constexpr double kFastestHz = 40, kShortest = 0.4, kLongest = 2.5, kLeastGap = 0.3, kMostGap = 0.8;
  constexpr double kMostSmallest = 0.5, kLeastRange = 0.1;
  enum Draw : std::uint64_t { kLength = 90, kGap, kByHand };
  Recording recording;
  recording.array = sensor.array, recording.body = sensor.body, recording.signal_scale = sensor.scale;
  recording.plate = "touched", recording.trial = recording.pass = 1, recording.source = "simulated";
  const double period = 1 / std::min(sensor.rate_hz, kFastestHz);
  const RandomStream of_all(seed, stream_hashed("touching"));
  Scene::Objects objects{.smallest = kMostSmallest * of_all.uniform(0)};
  objects.largest = std::lerp(objects.smallest + kLeastRange, 1.0, of_all.uniform(1));
  double begin = 0;
  for (std::uint64_t i = 0; begin < seconds; ++i) {
    const RandomStream random(seed, stream_hashed("touch") + 2 * i);
    const double length = kShortest * same_bits::pow(kLongest / kShortest, random.uniform(kLength));
    const double end = begin + length + std::lerp(kLeastGap, kMostGap, random.uniform(kGap));
    objects.kind = random.uniform(kByHand) < 0.5 ? "fingertip" : "mixed";
    Press press(sensor, objects, 2, random, RandomStream(seed, stream_hashed("touch") + 2 * i + 1),
                Scene::kSeconds / length);
    for (; period * static_cast<double>(recording.frames()) < std::min(end, seconds);) {
      const double t = period * static_cast<double>(recording.frames());
      recording.time_s.push_back(t);
      press.frame(t - begin, 0, recording);
    }
    begin = end;
  }
  return recording;
}

}  // namespace supertac
