#include "data/simulation/fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>

#include "data/sensors/rest_tracker.h"
#include "data/simulation/presses.h"
#include "io/files/json.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/parallel.h"
#include "io/numbers/random.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kSeconds = 30, kPenalty = 0.3, kMostUnlike = 8, kMostOfPrior = 0.6, kLeastFittedNoise = 2e-4;
constexpr std::size_t kNearest = 60;

// A number of a body as it is regressed: drawn evenly from `least` to `most` in this form, and its value
// there.
struct Form {
  const char* key;
  double Body::*of;
  double least, most;
  double (*value)(double form, double pitch_mm);
  bool may_be_none = false;  // not every array has it: what cannot be told is left out
};
double itself(double form, double) { return form; }
double exp_of(double form, double) { return same_bits::exp(form); }
// Of a knee k, 1 / (1 + k) is 0 for a linear response and tends to 1 where the lightest touch saturates.
const Form kForms[] = {{"skin_mm", &Body::skin_mm, same_bits::log(0.2), same_bits::log(1.5),
                        [](double f, double pitch_mm) { return pitch_mm * same_bits::exp(f); }},
                       {"knee", &Body::knee, 0.001, 0.85, [](double f, double) { return (1 - f) / f; }},
                       {"crosstalk_rows", &Body::crosstalk_rows, 0, 0.5, itself, true},
                       {"crosstalk_columns", &Body::crosstalk_columns, 0, 0.5, itself, true},
                       {"hysteresis_s", &Body::hysteresis_s, same_bits::log(0.01), 0, exp_of},
                       {"creep", &Body::creep, 0.001, 0.4, itself, true},
                       {"creep_s", &Body::creep_s, same_bits::log(0.5), same_bits::log(10), exp_of, true}};
constexpr std::size_t kNumbers = std::size(kForms);

// A number that the file states without an uncertainty is known, and is not looked for.
bool known(const Body& body, const Form& form) {
  return !body.uncertainty.contains(form.key) && body.*form.of != 0;
}

// The inverse of a symmetric positive definite matrix [d][d], in place (Gauss-Jordan).
void invert(std::vector<double>& a, std::size_t d) {
  for (std::size_t k = 0; k < d; ++k) {
    const double pivot = 1 / a[k * d + k];
    a[k * d + k] = 1;
    for (std::size_t j = 0; j < d; ++j) a[k * d + j] *= pivot;
    for (std::size_t i = 0; i < d; ++i) {
      if (i == k) continue;
      const double factor = std::exchange(a[i * d + k], 0.0);
      for (std::size_t j = 0; j < d; ++j) a[i * d + j] -= factor * a[k * d + j];
    }
  }
}

// The rests that were taken away when the touches were recorded: since then the sensor's file may have got
// those of a fit.
std::vector<float> rests_before(const Recording& r, const Sensor& sensor) {
  std::vector<float> rests = sensor.rest;
  if (const auto found = r.metadata.find("rest"); found != r.metadata.end()) {
    rests.clear();
    for (const auto& rest : parse_json_limited(found->second))
      if (rest.is_number()) rests.push_back(rest.get<float>());
  }
  if (rests.size() != sensor.array.signals())
    rests.assign(sensor.array.signals(), static_cast<float>(sensor.scale.rest));
  return rests;
}

// Rest of each signal between touches, and the noise as a share of the range, from the steps between
// neighbouring frames.
void measure(const Recording& r, Sensor& sensor) {
  const std::size_t signals = sensor.array.signals();
  std::vector<double> noises;
  std::vector<std::vector<float>> all(signals);
  for (std::size_t i = 0; i < r.signals.size(); ++i) all[i % signals].push_back(r.signals[i]);
  const std::vector<double> levels = rests_between_touches(all, sensor.array.channels, sensor.scale.span < 0);
  const std::vector<float> before = rests_before(r, sensor);
  std::vector<float> rest;
  for (std::size_t s = 0; s < signals; ++s) {
    std::vector<double> steps;
    for (std::size_t f = 1; f < all[s].size(); ++f)
      steps.push_back(std::abs(double{all[s][f]} - double{all[s][f - 1]}));
    noises.push_back(quantile(steps, 0.25) / (0.3186 * std::sqrt(2.0)) / std::abs(sensor.scale.span));
    const double gain = sensor.gain.empty() ? 1 : double{sensor.gain[s]};
    rest.push_back(static_cast<float>(double{before[s]} + (levels[s] - sensor.scale.rest) / gain));
  }
  if (sensor.array.channels == 1) sensor.rest = rest;
  sensor.body.noise = std::max(kLeastFittedNoise, median(noises));
  sensor.body.uncertainty.erase("noise");
}

}  // namespace

// Ridge regression of the forms on statistics, their squares and 1.
class BodyFitter::Regression {
 public:
  // statistics [n][s], forms [n][kNumbers]
  Regression(const std::vector<std::vector<double>>& statistics,
             const std::vector<std::vector<double>>& forms)
      : mean_(statistics.front().size()), deviation_(mean_.size()) {
    const auto n = static_cast<double>(statistics.size());
    for (const auto& s : statistics)
      for (std::size_t i = 0; i < s.size(); ++i) mean_[i] += s[i] / n;
    for (const auto& s : statistics)
      for (std::size_t i = 0; i < s.size(); ++i) deviation_[i] += (s[i] - mean_[i]) * (s[i] - mean_[i]) / n;
    for (double& d : deviation_) d = std::sqrt(d) + 1e-9;
    std::vector<std::vector<double>> x;
    for (const auto& s : statistics) x.push_back(features(s));
    width_ = x.front().size();
    inverse_.assign(width_ * width_, 0);
    for (std::size_t i = 0; i < width_; ++i) inverse_[i * width_ + i] = i == 0 ? 1e-6 : kPenalty;
    for (const auto& row : x)
      for (std::size_t i = 0; i < width_; ++i)
        for (std::size_t j = 0; j < width_; ++j) inverse_[i * width_ + j] += row[i] * row[j];
    invert(inverse_, width_);
    weights_.assign(width_ * kNumbers, 0);
    for (std::size_t row = 0; row < x.size(); ++row) {
      const std::vector<double> projected = times_inverse(x[row]);
      for (std::size_t i = 0; i < width_; ++i)
        for (std::size_t k = 0; k < kNumbers; ++k) weights_[i * kNumbers + k] += projected[i] * forms[row][k];
    }
    for (std::size_t row = 0; row < x.size(); ++row) {
      const std::vector<double> projected = times_inverse(x[row]);
      const double leverage = std::inner_product(x[row].begin(), x[row].end(), projected.begin(), 0.0);
      predicted_.push_back(predict(x[row]));
      left_out_.emplace_back();
      for (std::size_t k = 0; k < kNumbers; ++k)
        left_out_.back().push_back((forms[row][k] - predicted_.back()[k]) / std::max(0.05, 1 - leverage));
    }
  }

  std::vector<double> operator()(const std::vector<double>& statistics) const {
    return predict(features(statistics));
  }
  // Root mean square of the errors of the bodies whose number k was predicted nearest to `form`.
  double deviation(std::size_t k, double form) const {
    std::vector<std::size_t> order(predicted_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, {}, [&](std::size_t i) { return std::abs(predicted_[i][k] - form); });
    double squares = 0;
    const std::size_t count = std::min(kNearest, order.size());
    for (std::size_t i = 0; i < count; ++i) squares += left_out_[order[i]][k] * left_out_[order[i]][k];
    return std::sqrt(squares / static_cast<double>(count));
  }
  // The farthest that a statistic lies from the simulated ones.
  double unlike(const std::vector<double>& statistics) const {
    double most = 0;
    for (std::size_t i = 0; i < mean_.size(); ++i)
      most = std::max(most, std::abs(statistics[i] - mean_[i]) / deviation_[i]);
    return most;
  }

 private:
  std::vector<double> features(const std::vector<double>& statistics) const {
    std::vector<double> x = {1};
    for (std::size_t i = 0; i < mean_.size(); ++i)
      x.push_back(std::clamp((statistics[i] - mean_[i]) / deviation_[i], -4.0, 4.0));
    for (std::size_t i = 0; i < mean_.size(); ++i) x.push_back(x[i + 1] * x[i + 1] - 1);
    return x;
  }
  std::vector<double> times_inverse(const std::vector<double>& x) const {
    std::vector<double> y(width_);
    for (std::size_t i = 0; i < width_; ++i)
      for (std::size_t j = 0; j < width_; ++j) y[i] += inverse_[i * width_ + j] * x[j];
    return y;
  }
  std::vector<double> predict(const std::vector<double>& x) const {
    std::vector<double> y(kNumbers);
    for (std::size_t i = 0; i < width_; ++i)
      for (std::size_t k = 0; k < kNumbers; ++k) y[k] += x[i] * weights_[i * kNumbers + k];
    return y;
  }

  std::vector<double> mean_, deviation_, inverse_, weights_;
  std::vector<std::vector<double>> predicted_, left_out_;
  std::size_t width_ = 0;
};

std::vector<std::string> BodyFit::lines() const {
  std::vector<std::string> lines = {"noise " + format(100 * sensor.body.noise, 2) + " % of the range"};
  std::vector<std::string> untold;
  for (const FittedNumber& number : numbers) {
    if (number.told)
      lines.push_back(number.key + " " + format(number.value, 3) + " +- " + format(number.deviation, 2));
    else
      untold.push_back(number.key);
  }
  untold.emplace_back("gain (supertac-stream --probe --gain finds it)");
  lines.push_back("could not be told from these touches: " + joined(untold, ", "));
  return lines;
}

BodyFitter::BodyFitter(const Sensor& sensor, std::uint64_t seed) : sensor_(sensor) {
  const double pitch = std::sqrt(sensor.array.pitch_mm.x * sensor.array.pitch_mm.y);
  std::vector<std::vector<double>> statistics(kSimulations), forms(kSimulations);
  parallel_for(kSimulations, [&](std::size_t i) {
    const RandomStream random(seed, stream_named("body"));
    Sensor drawn = sensor;
    drawn.body.uncertainty = {};
    for (std::size_t k = 0; k < kNumbers; ++k) {
      forms[i].push_back(std::lerp(kForms[k].least, kForms[k].most, random.uniform(i * (kNumbers + 1) + k)));
      if (!known(sensor.body, kForms[k])) drawn.body.*kForms[k].of = kForms[k].value(forms[i].back(), pitch);
    }
    drawn.body.noise = 0.001 * same_bits::pow(10, random.uniform(i * (kNumbers + 1) + kNumbers));
    statistics[i] = touch_statistics(simulate_touching(drawn, kSeconds, seed * kSimulations + i));
  });
  // Some bodies show less than a touch.
  std::size_t kept = 0;
  for (std::size_t i = 0; i < statistics.size(); ++i)
    if (!statistics[i].empty())
      std::swap(statistics[kept], statistics[i]), std::swap(forms[kept++], forms[i]);
  statistics.resize(kept), forms.resize(kept);
  if (4 * kept < kSimulations)
    throw std::runtime_error("a body cannot be fitted to " + format(sensor.rate_hz) +
                             " frames a second: of half a minute too few would be touched; leave the fit "
                             "out, and presses are simulated of bodies as different as arrays are");
  regression_ = std::make_shared<const Regression>(statistics, forms);
}

BodyFit BodyFitter::operator()(const Recording& touches) const {
  BodyFit fit;
  fit.sensor = sensor_;
  measure(touches, fit.sensor);
  const std::vector<double> found = touch_statistics(touches);
  if (found.empty())
    throw std::runtime_error(
        "too little was pressed: expected 100 frames or more in which a taxel shows 8 % of the range; "
        "press here and there for half a minute, or let the probe find the range");
  if (const double unlike = regression_->unlike(found); unlike > kMostUnlike)
    throw std::runtime_error(
        "these touches are like none that were simulated (" + format(unlike, 3) +
        " standard deviations off, at most " + format(kMostUnlike) +
        "): look at the sensor's range, order and pitch first (supertac-stream --web), or leave "
        "the fit out");
  const double pitch = std::sqrt(sensor_.array.pitch_mm.x * sensor_.array.pitch_mm.y);
  const std::vector<double> predicted = (*regression_)(found);
  for (std::size_t k = 0; k < kNumbers; ++k) {
    const Form& form = kForms[k];
    if (known(sensor_.body, form)) {
      fit.numbers.push_back({form.key, sensor_.body.*form.of, 0, true});
      continue;
    }
    const double deviation = regression_->deviation(k, predicted[k]);
    const double of_prior = (form.most - form.least) / std::sqrt(12.0);
    const double inside = std::clamp(predicted[k], form.least, form.most);
    const auto value = [&](double of) { return form.value(std::clamp(of, form.least, form.most), pitch); };
    fit.numbers.push_back({.key = form.key,
                           .value = value(inside),
                           .deviation = std::abs(value(inside + deviation) - value(inside - deviation)) / 2,
                           .told = deviation < kMostOfPrior * of_prior});
  }
  // Creep without its time is nothing that could be simulated.
  FittedNumber &creep = fit.numbers[kNumbers - 2], &creep_s = fit.numbers[kNumbers - 1];
  creep.told = creep_s.told = creep.told && creep_s.told;
  for (std::size_t k = 0; k < kNumbers; ++k) {
    const FittedNumber& number = fit.numbers[k];
    if (known(sensor_.body, kForms[k]) || (kForms[k].may_be_none && !number.told)) continue;
    fit.sensor.body.*kForms[k].of = number.value;
    fit.sensor.body.uncertainty[number.key] = number.deviation;
  }
  return fit;
}

}  // namespace supertac
