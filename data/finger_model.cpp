#include "data/finger_model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/random.h"

namespace supertac {
namespace {

// Taxel gains of the rig: geometric means over fits to its recordings.
constexpr std::array<double, kTaxels> kGain = {0.90, 0.18, 0.10, 0.15, 1.60, 0.60, 0.20, 0.60,
                                               0.27, 0.55, 0.20, 0.65, 0.50, 0.40, 0.10, 0.80};
constexpr double kRestVolts = 2.442, kRestSpreadVolts = 0.003;
constexpr double kFullScaleVolts = 3.3;
constexpr double kLeastIndentationMm = -1.8;  // of 2.5 mm of texture the finger then still touches the top
constexpr int kAdcCodes = 4096;

// Points of the pad. Along the slide they are as fine as the tip of a ridge; across it little changes.
constexpr int kAcross = 9, kAlong = 89;
constexpr double kAcrossMm = 2, kAlongMm = 0.25;
constexpr double across_mm(int i) { return kAcrossMm * (i - kAcross / 2); }
constexpr double along_mm(int j) { return kAlongMm * (j - kAlong / 2); }
constexpr double kNoPadSigmaMm = 0.3;  // without a pad a taxel feels the points next to it

// Grid of the plate's surface: wide enough for the whole pad of a finger whose centre is on the plate.
constexpr double kCellMm = 0.25, kMarginMm = 12, kBesideMm = -3;
constexpr int kColumns = static_cast<int>((Plate::kWidthMm + 2 * kMarginMm) / kCellMm) + 1;
constexpr int kRows = static_cast<int>((Plate::kLengthMm + 2 * kMarginMm) / kCellMm) + 1;

struct Term {
  const char* name;
  bool SimulatorSettings::*on;
};
constexpr Term kTerms[] = {
    {"mount", &SimulatorSettings::with_mount},         {"pad", &SimulatorSettings::with_pad},
    {"dome", &SimulatorSettings::with_dome},           {"edges", &SimulatorSettings::with_edges},
    {"tilt", &SimulatorSettings::with_tilt},           {"gains", &SimulatorSettings::with_gains},
    {"variation", &SimulatorSettings::with_variation}, {"vibration", &SimulatorSettings::with_vibration},
    {"drift", &SimulatorSettings::with_drift},         {"emi", &SimulatorSettings::with_emi},
    {"noise", &SimulatorSettings::with_noise},         {"adc", &SimulatorSettings::with_adc},
    {"filter", &SimulatorSettings::with_filter},       {"saturation", &SimulatorSettings::with_saturation},
    {"jitter", &SimulatorSettings::with_jitter},       {"loss", &SimulatorSettings::with_loss},
};

// sin(2 pi turns) to 2e-4 from products only, so that simulated bits do not depend on the C library.
double sine(double turns) {
  double u = turns - std::floor(turns);
  const double sign = u < 0.5 ? 1 : -1;
  if (u >= 0.5) u -= 0.5;
  const double q = 4 * (u - 0.25), q2 = q * q;  // cos(pi q / 2), |q| <= 1
  return sign * (1 - q2 * (1.2333 - q2 * (0.2526 - q2 * 0.0193)));
}

// As often half as twice.
double factor(double v) { return v >= 0 ? 1 + v : 1 / (1 - v); }

// exp(-d^2 / 2 sigma^2) nearly, from products only: (1 - d^2 / 16 sigma^2)^8, 0 beyond 4 sigma.
double bell(double distance, double sigma) {
  const double rest = std::max(0.0, 1 - distance * distance / (16 * sigma * sigma));
  const double squared = rest * rest, fourth = squared * squared;
  return fourth * fourth;
}

// Weights of `points` places for the taxels of four columns or rows, [4][points]; each row sums to 1.
template <class Place>
std::vector<double> taxel_weights(int points, Place place, double sigma) {
  std::vector<double> weights;
  for (int line = 0; line < 4; ++line) {
    const double at = -4.5 + 3.0 * line;
    double sum = 0;
    for (int i = 0; i < points; ++i) sum += bell(place(i) - at, sigma);
    for (int i = 0; i < points; ++i) weights.push_back(bell(place(i) - at, sigma) / sum);
  }
  return weights;
}

uint64_t hash_text(const std::string& text) {  // FNV-1a
  uint64_t hash = 1469598103934665603ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

// Streams: what belongs to the sensor, to a trial of a plate (one mounting), to a pass, and to a sample.
uint64_t mounting_stream(const Plate& plate, int trial) {
  return hash_text(plate.name() + "/" + std::to_string(trial));
}
uint64_t pass_stream(const Plate& plate, const FingerIdentity& id) {
  return hash_text(plate.name() + "/" + std::to_string(id.trial) + "/" + std::to_string(id.pass) + "/" +
                   std::to_string(static_cast<long long>(id.speed_mm_s * 1000)));
}

}  // namespace

const std::vector<std::string>& simulator_terms() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names;
    for (const Term& term : kTerms) names.emplace_back(term.name);
    return names;
  }();
  return kNames;
}

SimulatorSettings without_term(SimulatorSettings settings, const std::string& name) {
  std::string known;
  for (const Term& term : kTerms) {
    if (name == term.name) {
      settings.*term.on = false;
      return settings;
    }
    known += known.empty() ? term.name : std::string(", ") + term.name;
  }
  throw std::invalid_argument("simulator: unknown term \"" + name + "\"; known are " + known);
}

FingerModel::FingerModel(const Plate& plate, const SimulatorSettings& settings, const FingerIdentity& id)
    : settings_(settings), noise_seed_(id.seed), noise_stream_(pass_stream(plate, id) + 1) {
  const RandomStream sensor(id.seed, 0), trial(id.seed, mounting_stream(plate, id.trial));
  const RandomStream pass(id.seed, pass_stream(plate, id));
  const double variation = settings.with_variation ? 1 : 0;
  const double spread = variation * settings.gain_spread;
  const double common_gain = factor(spread * pass.normal(1000));
  const double tilt = settings.with_tilt ? settings.tilt_mm_per_mm : 0;
  const double tilt_spread = settings.with_tilt ? variation * settings.tilt_spread : 0;
  const double slope_y = tilt + tilt_spread * trial.normal(1001), slope_x = tilt_spread * trial.normal(1002);
  for (int k = 0; k < kTaxels; ++k) {
    const auto c = static_cast<uint64_t>(k);
    const double own = factor(spread * trial.normal(c)) * factor(spread / 3 * pass.normal(c));
    gain_[c] = (settings.with_gains ? kGain[c] : 0.5) * own * common_gain;
    rest_[c] = kRestVolts + variation * kRestSpreadVolts * sensor.normal(c);
    drift_[c] = settings.with_drift ? settings.drift_volts_per_s * pass.normal(100 + c) : 0;
  }
  const double press = trial.normal(1003) + pass.normal(1003);
  const double indentation = settings.indentation_mm + variation * settings.indentation_spread_mm * press;
  indentation_mm_ = std::max(kLeastIndentationMm, indentation);
  vibration_phase_ = pass.uniform(1004);
  emi_phase_ = pass.uniform(1005);

  map_.resize(static_cast<size_t>(kColumns) * kRows);
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c) {
      const double x = c * kCellMm - kMarginMm, y = r * kCellMm - kMarginMm;
      const bool beside = x < 0 || x > Plate::kWidthMm || y < 0 || y > Plate::kLengthMm;
      map_[static_cast<size_t>(r * kColumns + c)] =
          beside && settings.with_edges ? kBesideMm : plate.height(x, y);
    }
  shape_pad(slope_x, slope_y);
}

void FingerModel::shape_pad(double slope_x, double slope_y) {
  const double sigma = settings_.with_pad ? settings_.pad_sigma_mm : kNoPadSigmaMm;
  across_weight_ = taxel_weights(kAcross, across_mm, sigma);
  along_weight_ = taxel_weights(kAlong, along_mm, sigma);
  const double curvature = settings_.with_dome ? 1 / (2 * settings_.dome_radius_mm) : 0;
  double lowest = 0;
  for (int i = 0; i < kAcross; ++i)
    for (int j = 0; j < kAlong; ++j) {
      const double x = across_mm(i), y = along_mm(j);
      rise_.push_back(curvature * (x * x + y * y) + slope_x * x + slope_y * y);
      lowest = std::min(lowest, rise_.back());
    }
  for (double& rise : rise_) rise -= lowest;
}

double FingerModel::surface(double x_mm, double y_mm) const {
  const double u = std::clamp((x_mm + kMarginMm) / kCellMm, 0.0, kColumns - 1.001);
  const double v = std::clamp((y_mm + kMarginMm) / kCellMm, 0.0, kRows - 1.001);
  const auto c = static_cast<size_t>(u), r = static_cast<size_t>(v);
  const double fu = u - static_cast<double>(c), fv = v - static_cast<double>(r);
  const double* row = &map_[r * kColumns + c];
  const double near = row[0] + fu * (row[1] - row[0]);
  const double far = row[kColumns] + fu * (row[kColumns + 1] - row[kColumns]);
  return near + fv * (far - near);
}

std::array<double, kTaxels> FingerModel::loads(const FingerPose& pose) const {
  std::array<double, kAcross * kAlong> depth;
  for (int i = 0; i < kAcross; ++i)
    for (int j = 0; j < kAlong; ++j) {
      const auto at = static_cast<size_t>(i * kAlong + j);
      depth[at] = surface(pose.x_mm + across_mm(i), pose.y_mm + along_mm(j)) - rise_[at] - pose.z_mm;
    }
  // Balance of the mount. The excess force is convex and falls with the lift, so Newton's steps from lift 0
  // approach the root from below and never pass it; once the same points touch as before, the last step was
  // exact.
  double lift = 0, last_slope = 0;
  for (int step = 0; settings_.with_mount && step < 12; ++step) {
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
  std::array<double, kTaxels> load{};
  for (size_t i = 0; i < kAcross; ++i) {
    std::array<double, 4> rows{};
    for (size_t j = 0; j < kAlong; ++j) {
      const double indented = depth[i * kAlong + j] - lift;
      if (indented <= 0) continue;
      for (size_t row = 0; row < 4; ++row) rows[row] += along_weight_[row * kAlong + j] * indented;
    }
    for (size_t k = 0; k < kTaxels; ++k) load[k] += across_weight_[k % 4 * kAcross + i] * rows[k / 4];
  }
  return load;
}

std::array<double, kTaxels> FingerModel::volts(const FingerPose& pose, double time_s) const {
  FingerPose shaken = pose;
  if (settings_.with_vibration)
    shaken.z_mm += settings_.vibration_mm * sine(settings_.vibration_hz * time_s + vibration_phase_);
  const std::array<double, kTaxels> load = loads(shaken);
  const double emi =
      settings_.with_emi ? settings_.emi_volts * sine(settings_.emi_hz * time_s + emi_phase_) : 0;
  const RandomStream noise(noise_seed_, noise_stream_);
  const auto tick = static_cast<uint64_t>(std::llround(std::max(0.0, time_s) * 1e6));
  std::array<double, kTaxels> volts{};
  for (size_t k = 0; k < kTaxels; ++k) {
    volts[k] = rest_[k] + drift_[k] * time_s + emi - settings_.volts_per_load * gain_[k] * load[k];
    if (settings_.with_noise) volts[k] += settings_.noise_volts * noise.normal(tick * kTaxels + k);
  }
  return volts;
}

int FingerModel::adc(double volts) {
  return static_cast<int>(
      std::clamp(std::lround(volts / kFullScaleVolts * kAdcCodes), 0L, long{kAdcCodes - 1}));
}

double FingerModel::volts_of_adc(int code) { return code * kFullScaleVolts / kAdcCodes; }

}  // namespace supertac
