#include "data/simulation/simulator.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// Taxel gains of the rig: geometric means over fits to its recordings. Of another array nothing is known.
constexpr double kGain[rig::kTaxels] = {0.90, 0.18, 0.10, 0.15, 1.60, 0.60, 0.20, 0.60,
                                        0.27, 0.55, 0.20, 0.65, 0.50, 0.40, 0.10, 0.80};
// Of three axes: how far below rest those along the plate are where nothing leans, and the skin that is
// dragged.
constexpr double kMiddleVolts = (rig::kRestVolts - rig::kFloorVolts) / 2, kFriction = 0.3;

constexpr int kPointsOfATaxel = 16;  // along its side

// Points of the pad. Along the slide they are as fine as the tip of a ridge; across it little changes.
constexpr double kAcrossMm = 2, kAlongMm = 0.25;
constexpr double kBeyondAcrossMm = 3.5, kBeyondAlongMm = 6.5;  // the outermost taxels

// An odd number of points, `step` apart, that reach `beyond` the outermost of `lines` lines of taxels.
int points_of(int lines, double pitch, double beyond, double step) {
  return 2 * static_cast<int>(std::ceil(((lines - 1) / 2.0 * pitch + beyond) / step)) + 1;
}
int points_across(const TaxelArray& a) {
  return points_of(a.columns, a.pitch_mm.x, kBeyondAcrossMm, kAcrossMm);
}
int points_along(const TaxelArray& a) { return points_of(a.rows, a.pitch_mm.y, kBeyondAlongMm, kAlongMm); }

// Grid of the plate's surface: wide enough for the rig's whole pad with its centre on the plate; beyond it
// everything is as at its edge.
constexpr double kCellMm = 0.25, kMarginMm = 12;
constexpr int kColumns = static_cast<int>((rig::kPlateWidthMm + 2 * kMarginMm) / kCellMm) + 1;
constexpr int kRows = static_cast<int>((rig::kPlateLengthMm + 2 * kMarginMm) / kCellMm) + 1;

// As often half as twice.
double factor(double v) { return v >= 0 ? 1 + v : 1 / (1 - v); }

std::uint64_t pass_stream(const Plate& plate, const PassSettings& pass) {
  return stream_hashed(plate.name() + "/" + std::to_string(pass.trial) + "/" + std::to_string(pass.pass) +
                       "/" + std::to_string(static_cast<long long>(pass.speed_mm_s * 1000)));
}

}  // namespace

TaxelWeights::TaxelWeights(int lines, double pitch, int places, double first, double step, double bell,
                           double sigma, double taxel) {
  const int points = taxel > 0 ? kPointsOfATaxel : 1;
  for (int line = 0; line < lines; ++line) {
    const double at = (line - (lines - 1) / 2.0) * pitch;
    std::vector<double> own(static_cast<std::size_t>(places));
    double sum = 0;
    for (int i = 0; i < places; ++i) {
      double& weight = own[static_cast<std::size_t>(i)];
      for (int p = 0; p < points; ++p)
        weight += same_bits::bell(first + i * step - at - taxel * ((p + 0.5) / points - 0.5), bell);
      sum += weight;
    }
    for (int i = 0; i < places; ++i) {
      load.push_back(own[static_cast<std::size_t>(i)] / sum);
      lean.push_back(load.back() * (first + i * step - at) / sigma);
    }
  }
}

std::vector<double> taxel_loads(const TaxelArray& array, std::span<const double> pressed,
                                std::size_t across_step, std::size_t along_step,
                                const std::vector<double>& across_weights,
                                const std::vector<double>& along_weights) {
  const auto rows = static_cast<std::size_t>(array.rows), columns = static_cast<std::size_t>(array.columns),
             across = across_weights.size() / columns, along = along_weights.size() / rows;
  std::vector<double> loads;
  for (std::size_t row = 0; row < rows; ++row) {
    std::vector<double> line(across);
    for (std::size_t j = 0; j < along; ++j)
      if (const double weight = along_weights[row * along + j]; weight != 0)  // a bell ends
        for (std::size_t i = 0; i < across; ++i)
          line[i] += weight * pressed[i * across_step + j * along_step];
    for (auto weights = across_weights.begin(); weights != across_weights.end();
         weights += static_cast<std::ptrdiff_t>(across))
      loads.push_back(std::inner_product(line.begin(), line.end(), weights, 0.0));
  }
  return loads;
}

FingerModel::FingerModel(const Plate& plate, const SimulatorSettings& settings, const PassSettings& of_pass,
                         std::uint64_t seed)
    : settings_(settings), noise_(seed, pass_stream(plate, of_pass) + 1) {
  settings.array.check();
  if (settings.array.channels != 1 && settings.array.channels != 3)
    throw std::invalid_argument(
        refusal("simulator", "array", "one channel or three axes", settings.array.text()));
  if (settings_.body.skin_mm == 0) settings_.body.skin_mm = Body::of_rig().skin_mm;
  // Of the sensor, of a trial of a plate (one mounting), and of a pass.
  const RandomStream sensor(seed, 0),
      trial(seed, stream_hashed(plate.name() + "/" + std::to_string(of_pass.trial)));
  const RandomStream pass(seed, pass_stream(plate, of_pass));
  const double variation = settings.with_variation ? 1 : 0;
  const double spread = variation * settings.gain_spread;
  const double common_gain = factor(spread * pass.normal(1000));
  const double tilt_spread = variation * settings.tilt_spread;
  const double slope_y = tilt_spread * trial.normal(1001), slope_x = tilt_spread * trial.normal(1002);
  const bool rig = settings.array.rows == rig::kTaxelRows && settings.array.columns == rig::kTaxelColumns;
  const auto taxels = static_cast<std::uint64_t>(settings.array.taxels());
  const std::uint64_t drifts = 100 * (1 + taxels / 100);  // numbers that no gain has taken
  for (std::uint64_t c = 0; c < taxels; ++c) {
    const double own = factor(spread * trial.normal(c)) * factor(spread / 3 * pass.normal(c));
    gain_.push_back((settings.with_gains && rig ? kGain[c] : 0.5) * own * common_gain);
    threshold_.push_back(settings.threshold_mm * std::abs(trial.normal(2000 + c)));
    rest_.push_back(rig::kRestVolts + variation * 0.003 * sensor.normal(c));
    drift_.push_back(settings.drift_volts_per_s * pass.normal(drifts + c));
  }
  const double press = trial.normal(1003) + pass.normal(1003);
  const double indentation = settings.indentation_mm + variation * settings.indentation_spread_mm * press;
  indentation_mm_ = std::max(-1.8, indentation);  // it still touches the top of 2.5 mm of texture
  vibration_phase_ = pass.uniform(1004);
  emi_phase_ = pass.uniform(1005);

  map_.resize(static_cast<std::size_t>(kColumns) * kRows);
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c) {
      const double x = c * kCellMm - kMarginMm, y = r * kCellMm - kMarginMm;
      const bool beside = x < 0 || x > rig::kPlateWidthMm || y < 0 || y > rig::kPlateLengthMm;
      map_[static_cast<std::size_t>(r * kColumns + c)] =
          beside && settings.with_edges ? -3 : plate.height(x, y);
    }
  shape_pad(slope_x, slope_y);
}

void FingerModel::shape_pad(double slope_x, double slope_y) {
  const double sigma = settings_.body.sigma_mm();
  const auto [rows, columns, pitch, channels] = settings_.array;
  across_ = points_across(settings_.array), along_ = points_along(settings_.array);
  const auto points = [](const TaxelArray& a) {
    return static_cast<double>(points_across(a) * points_along(a));
  };
  // Of a dome no more touches where the array is larger.
  if (settings_.body.shape == BodyShape::flat)
    settings_.mount_stiffness *= points(settings_.array) / points(TaxelArray{});
  across_weights_ =
      TaxelWeights(columns, pitch.x, across_, -kAcrossMm * (across_ / 2), kAcrossMm, sigma, sigma);
  along_weights_ = TaxelWeights(rows, pitch.y, along_, -kAlongMm * (along_ / 2), kAlongMm, sigma, sigma);
  double lowest = 0;
  for (int i = 0; i < across_; ++i)
    for (int j = 0; j < along_; ++j) {
      const double x = kAcrossMm * (i - across_ / 2), y = kAlongMm * (j - along_ / 2);
      rise_.push_back(settings_.body.depth_mm(x, y) + slope_x * x + slope_y * y);
      lowest = std::min(lowest, rise_.back());
    }
  for (double& rise : rise_) rise -= lowest;
}

double FingerModel::surface(double x_mm, double y_mm) const {
  const double u = std::clamp((x_mm + kMarginMm) / kCellMm, 0.0, kColumns - 1.001);
  const double v = std::clamp((y_mm + kMarginMm) / kCellMm, 0.0, kRows - 1.001);
  const auto c = static_cast<std::size_t>(u), r = static_cast<std::size_t>(v);
  const double fu = u - static_cast<double>(c), fv = v - static_cast<double>(r);
  const double* row = &map_[r * kColumns + c];
  const double near = row[0] + fu * (row[1] - row[0]);
  const double far = row[kColumns] + fu * (row[kColumns + 1] - row[kColumns]);
  return near + fv * (far - near);
}

std::vector<double> FingerModel::indented(const FingerPose& pose) const {
  std::vector<double> depth(rise_.size());
  for (int i = 0; i < across_; ++i)
    for (int j = 0; j < along_; ++j) {
      const auto at = static_cast<std::size_t>(i * along_ + j);
      const double x = kAcrossMm * (i - across_ / 2), y = kAlongMm * (j - along_ / 2);
      depth[at] =
          surface(pose.x_mm + x, pose.y_mm + y) - rise_[at] - pose.slope_x * x - pose.slope_y * y - pose.z_mm;
    }
  // Balance of the mount. The excess force is convex and falls with the lift, so Newton's steps from lift 0
  // approach the root from below and never pass it; once the same points touch as before, the last step was
  // exact.
  double lift = 0, last_slope = 0;
  for (int step = 0; step < 12; ++step) {
    double excess = -settings_.mount_stiffness * lift, slope = settings_.mount_stiffness;
    for (const double d : depth) {
      const double indented = std::max(0.0, d - lift);
      excess += kAcrossMm * kAlongMm * indented;
      slope += indented > 0 ? kAcrossMm * kAlongMm : 0.0;
    }
    if (slope == last_slope) break;
    last_slope = slope;
    lift += excess / slope;
  }
  for (double& d : depth) d = std::max(0.0, d - lift);
  return depth;
}

std::vector<double> FingerModel::volts(const FingerPose& pose, double time_s) const {
  FingerPose shaken = pose;
  shaken.z_mm +=
      settings_.vibration_mm * same_bits::rough_sine(settings_.vibration_hz * time_s + vibration_phase_);
  const std::vector<double> depth = indented(shaken);
  const auto felt_by = [&](const std::vector<double>& across, const std::vector<double>& along) {
    return taxel_loads(settings_.array, depth, static_cast<std::size_t>(along_), 1, across, along);
  };
  const std::vector<double> load = felt_by(across_weights_.load, along_weights_.load);
  const double emi = settings_.emi_volts * same_bits::rough_sine(settings_.emi_hz * time_s + emi_phase_);
  const auto channels = static_cast<std::size_t>(settings_.array.channels);
  std::vector<double> volts(load.size() * channels);
  const auto disturbed = [&](std::size_t k, double drop) {
    return rest_[k] + drift_[k] * time_s + emi - settings_.volts_per_load * gain_[k] * drop;
  };
  for (std::size_t k = 0; k < load.size(); ++k)
    volts[k * channels + channels - 1] = disturbed(k, std::max(0.0, load[k] - threshold_[k]));
  if (channels == 3) {
    const std::vector<double> lean_x = felt_by(across_weights_.lean, along_weights_.load),
                              lean_y = felt_by(across_weights_.load, along_weights_.lean);
    for (std::size_t k = 0; k < load.size(); ++k) {
      volts[3 * k] = disturbed(k, lean_x[k]) - kMiddleVolts;
      volts[3 * k + 1] = disturbed(k, lean_y[k] - kFriction * load[k]) - kMiddleVolts;
    }
  }
  const auto tick = static_cast<std::uint64_t>(std::llround(std::max(0.0, time_s) * 1e6));
  for (std::size_t s = 0; settings_.noise_volts > 0 && s < volts.size(); ++s)
    volts[s] += settings_.noise_volts * noise_.normal(tick * volts.size() + s);
  return volts;
}

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
void wander(double strength, std::uint64_t seed, std::uint64_t stream, FingerPose& pose) {
  if (strength <= 0) return;
  const auto rocks = [&](std::uint64_t which) {
    return strength * rocking({seed, stream_named("wander") + stream + which}, pose.y_mm);
  };
  pose.slope_x += rocks(0), pose.slope_y += rocks(1), pose.z_mm += 4 * rocks(2);
}

void check(const PassSettings& pass, const SimulatorSettings& settings) {
  const auto require = [](bool holds, const char* argument, const std::string& expected, double found) {
    if (!holds) throw std::invalid_argument(refusal("simulate_pass", argument, expected, format(found)));
  };
  const double speed = pass.speed_mm_s, rate = settings.rate_hz, from = pass.from_mm, to = pass.to_mm,
               end = rig::kPlateLengthMm;
  require(std::isfinite(speed) && speed > 0, "speed_mm_s", "a finite number above 0", speed);
  require(std::isfinite(rate) && rate > 0, "rate_hz", "a finite number above 0", rate);
  require(from >= 0 && from < end, "from_mm", "0 to below " + format(end), from);
  require(to > from && to <= end, "to_mm", "above from_mm, " + format(from) + ", to " + format(end), to);
  const bool known = pass.pass >= 1 && pass.pass <= rig::kPasses;
  require(known, "pass", "1 to " + std::to_string(rig::kPasses), pass.pass);
  require(pass.trial >= 1, "trial", "1 or more", pass.trial);
}

// The mean of the newest sample and those before it, `length` in all or as many as there are.
std::vector<double> averaged(const std::vector<double>& newest, std::size_t length,
                             std::deque<std::vector<double>>& recent) {
  recent.push_back(newest);
  if (recent.size() > length) recent.pop_front();
  std::vector<double> mean(newest.size());
  for (const auto& sample : recent)
    for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += sample[k];
  for (double& m : mean) m /= static_cast<double>(recent.size());
  return mean;
}

}  // namespace

Recording simulate_pass(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings,
                        std::uint64_t seed) {
  check(pass, settings);
  const FingerModel finger(plate, settings, pass, seed);
  const double duration = 2 * kLiftS + slide_s(pass) + return_s(pass);
  const auto frames = static_cast<std::size_t>(std::floor(duration * settings.rate_hz + 0.5));
  // Rocking, jitter and losses have streams of their own for each pass, so that a loss in one pass does not
  // move another's.
  const std::uint64_t stream = pass_stream(plate, pass) + 1;
  const RandomStream timing(seed, stream_named("time") + stream);
  const auto length =
      static_cast<std::size_t>(std::max(1L, std::lround(settings.filter_s * settings.rate_hz)));
  std::deque<std::vector<double>> recent;
  BodyResponse response(settings.body, settings.array);
  Recording recording;
  recording.array = settings.array, recording.body = settings.body, recording.plate = plate.name();
  recording.trial = pass.trial, recording.pass = pass.pass, recording.speed_mm_s = pass.speed_mm_s;
  recording.source = "simulated";
  recording.metadata["seed"] = std::to_string(seed);
  recording.metadata["rate_hz"] = format(settings.rate_hz);
  recording.metadata["filter_s"] = format(settings.filter_s);
  for (std::size_t i = 0; i < frames; ++i) {
    const double stamp = static_cast<double>(i) / settings.rate_hz;
    const double taken = stamp + settings.jitter_s * timing.normal(2 * i);
    FingerPose felt = pose_at(taken, pass);
    felt.z_mm += finger.slide_z_mm();
    wander(settings.wander, seed, stream, felt);
    std::vector<double> volts = finger.volts(felt, taken);
    if (settings.with_adc)
      for (double& v : volts) v = rig::volts_of(rig::adc_of(v));
    if (!response.neutral()) {
      for (double& v : volts) v = (recording.signal_scale.rest - v) / recording.signal_scale.span;
      response(1 / settings.rate_hz, volts);
      for (double& v : volts) v = recording.signal_scale.rest - recording.signal_scale.span * v;
    }
    volts = averaged(volts, length, recent);
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
