#include "data/finger_model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/random.h"

namespace supertac {
namespace {

// Taxel gains as they come out of the rig's recordings (median depth of the dips, 1 = reaches the floor).
constexpr std::array<double, kTaxels> kGain = {0.90, 0.25, 0.15, 0.25, 1.00, 0.45, 0.18, 0.50,
                                               0.25, 0.45, 0.20, 0.65, 0.60, 0.35, 0.12, 0.85};
constexpr double kRestVolts = 2.442, kRestSpreadVolts = 0.003;
constexpr double kFullScaleVolts = 3.3;
constexpr int kAdcCodes = 4096;

// Grid of the averaged surface: wide enough for every taxel of a finger whose centre is on the plate.
constexpr double kCellMm = 0.25, kMarginMm = 12, kBesideMm = -3;
constexpr int kColumns = static_cast<int>((Plate::kWidthMm + 2 * kMarginMm) / kCellMm) + 1;
constexpr int kRows = static_cast<int>((Plate::kLengthMm + 2 * kMarginMm) / kCellMm) + 1;

struct Term {
  const char* name;
  bool SimulatorSettings::*on;
};
constexpr Term kTerms[] = {
    {"mount", &SimulatorSettings::with_mount},
    {"pad", &SimulatorSettings::with_pad},
    {"dome", &SimulatorSettings::with_dome},
    {"edges", &SimulatorSettings::with_edges},
    {"tilt", &SimulatorSettings::with_tilt},
    {"gains", &SimulatorSettings::with_gains},
    {"variation", &SimulatorSettings::with_variation},
    {"crosstalk", &SimulatorSettings::with_crosstalk},
    {"vibration", &SimulatorSettings::with_vibration},
    {"drift", &SimulatorSettings::with_drift},
    {"emi", &SimulatorSettings::with_emi},
    {"noise", &SimulatorSettings::with_noise},
    {"adc", &SimulatorSettings::with_adc},
    {"filter", &SimulatorSettings::with_filter},
    {"saturation", &SimulatorSettings::with_saturation},
    {"jitter", &SimulatorSettings::with_jitter},
    {"loss", &SimulatorSettings::with_loss},
};

// sin(2 pi turns) to 2e-4 from products only, so that simulated bits do not depend on the C library.
double sine(double turns) {
  double u = turns - std::floor(turns);
  const double sign = u < 0.5 ? 1 : -1;
  if (u >= 0.5) u -= 0.5;
  const double q = 4 * (u - 0.25), q2 = q * q;  // cos(pi q / 2), |q| <= 1
  return sign * (1 - q2 * (1.2333 - q2 * (0.2526 - q2 * 0.0193)));
}

double hertz(double indentation) { return indentation > 0 ? indentation * std::sqrt(indentation) : 0.0; }

// Mean over `cells` (odd) neighbours of a line of `count` elements, `step` apart; the ends repeat.
void box_mean(double* line, int count, int step, int cells, std::vector<double>& copy) {
  copy.resize(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) copy[static_cast<size_t>(i)] = line[static_cast<ptrdiff_t>(i) * step];
  const int half = cells / 2;
  for (int i = 0; i < count; ++i) {
    double sum = 0;
    for (int j = i - half; j <= i + half; ++j) sum += copy[static_cast<size_t>(std::clamp(j, 0, count - 1))];
    line[static_cast<ptrdiff_t>(i) * step] = sum / cells;
  }
}

std::array<double, kTaxels> mix_with_neighbours(const std::array<double, kTaxels>& load, double share) {
  std::array<double, kTaxels> mixed{};
  for (int k = 0; k < kTaxels; ++k) {
    const int row = k / 4, column = k % 4;
    double sum = 0;
    if (row > 0) sum += load[static_cast<size_t>(k - 4)];
    if (row < 3) sum += load[static_cast<size_t>(k + 4)];
    if (column > 0) sum += load[static_cast<size_t>(k - 1)];
    if (column < 3) sum += load[static_cast<size_t>(k + 1)];
    mixed[static_cast<size_t>(k)] = (1 - share) * load[static_cast<size_t>(k)] + share / 4 * sum;
  }
  return mixed;
}

uint64_t hash_text(const std::string& text) {  // FNV-1a
  uint64_t hash = 1469598103934665603ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

// Streams: what belongs to the sensor, to a trial (one mounting of the finger), to a pass, and to a sample.
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
  const RandomStream sensor(id.seed, 0), trial(id.seed, 1 + static_cast<uint64_t>(id.trial));
  const RandomStream pass(id.seed, pass_stream(plate, id));
  const double variation = settings.with_variation ? 1 : 0;
  const double spread = variation * settings.gain_spread;
  const double common_gain = 1 + spread * pass.normal(1000);
  const double tilt = settings.with_tilt ? settings.tilt_mm_per_mm : 0;
  const double tilt_spread = settings.with_tilt ? variation * settings.tilt_spread : 0;
  const double slope_y = -tilt + tilt_spread * trial.normal(1001), slope_x = tilt_spread * trial.normal(1002);
  for (int k = 0; k < kTaxels; ++k) {
    const auto c = static_cast<uint64_t>(k);
    const double own = (1 + spread * trial.normal(c)) * (1 + spread / 3 * pass.normal(c));
    gain_[c] = std::max(0.0, (settings.with_gains ? kGain[c] : 0.5) * own * common_gain);
    rest_[c] = kRestVolts + variation * kRestSpreadVolts * sensor.normal(c);
    drift_[c] = settings.with_drift ? settings.drift_volts_per_s * pass.normal(100 + c) : 0;
    tilt_[c] = slope_x * taxel_x_mm(k) + slope_y * taxel_y_mm(k);
  }
  const double press = trial.normal(1003) + pass.normal(1003);
  indentation_mm_ =
      std::max(0.05, settings.indentation_mm + variation * settings.indentation_spread_mm * press);
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
  if (settings.with_pad) average_surface();
}

// Three box means come close to a Gaussian: variance 3 w^2 / 12, so w = 2 sigma.
void FingerModel::average_surface() {
  const int half = static_cast<int>(std::lround(settings_.pad_sigma_mm / kCellMm));
  std::vector<double> copy;
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (int r = 0; r < kRows; ++r)
      box_mean(&map_[static_cast<size_t>(r * kColumns)], kColumns, 1, 2 * half + 1, copy);
    for (int c = 0; c < kColumns; ++c)
      box_mean(&map_[static_cast<size_t>(c)], kRows, kColumns, 2 * half + 1, copy);
  }
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
  const double dome = settings_.with_dome ? settings_.dome : 1;
  std::array<double, kTaxels> depth{};
  for (int k = 0; k < kTaxels; ++k) {
    const auto c = static_cast<size_t>(k);
    depth[c] =
        surface(pose.x_mm + dome * taxel_x_mm(k), pose.y_mm + dome * taxel_y_mm(k)) + tilt_[c] - pose.z_mm;
  }
  // Balance of the mount: stiffness * lift = sum of loads. The excess load is convex and falls with the lift,
  // so Newton's steps from lift 0 approach the root from below and never pass it.
  double lift = 0;
  for (int step = 0; settings_.with_mount && step < 8; ++step) {
    double excess = -settings_.mount_stiffness * lift, slope = settings_.mount_stiffness;
    for (const double d : depth) {
      if (d <= lift) continue;
      const double root = std::sqrt(d - lift);
      excess += (d - lift) * root;
      slope += 1.5 * root;
    }
    lift += excess / slope;
  }
  std::array<double, kTaxels> load{};
  for (size_t k = 0; k < kTaxels; ++k) load[k] = hertz(depth[k] - lift);
  return load;
}

std::array<double, kTaxels> FingerModel::volts(const FingerPose& pose, double time_s) const {
  FingerPose shaken = pose;
  if (settings_.with_vibration)
    shaken.z_mm += settings_.vibration_mm * sine(settings_.vibration_hz * time_s + vibration_phase_);
  std::array<double, kTaxels> load = loads(shaken);
  if (settings_.with_crosstalk) load = mix_with_neighbours(load, settings_.crosstalk);
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
