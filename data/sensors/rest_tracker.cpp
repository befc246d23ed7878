#include "data/sensors/rest_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/numbers/median.h"

namespace supertac {

RestTracker::RestTracker(const Sensor& sensor)
    : scale_(sensor.scale),
      either_way_(sensor.array.channels == 3),
      time_constant_s_(sensor.follow_rest_s),
      before_s_(std::numeric_limits<double>::quiet_NaN()),
      band_(0.15),
      mean_(sensor.array.signals(), std::numeric_limits<double>::quiet_NaN()),
      rate_(sensor.array.signals(), 0),
      rest_(sensor.array.signals(), sensor.scale.rest) {}

void RestTracker::follow(double time_s, std::span<float> signals) {
  if (time_constant_s_ == 0) return;
  const double dt = std::isnan(before_s_) ? 0 : std::clamp(time_s - before_s_, 0.0, 1.0);
  before_s_ = time_s;
  double away = 0;
  for (std::size_t s = 0; s < signals.size(); ++s) {
    const double signal = double{signals[s]};
    if (!std::isfinite(signal)) continue;
    mean_[s] = std::isnan(mean_[s]) ? signal : mean_[s] + std::min(1.0, dt / 0.2) * (signal - mean_[s]);
    const double pressed = (rest_[s] - mean_[s]) / scale_.span;
    away = std::max(away, either_way_ ? std::abs(pressed) : pressed);
  }
  free_s_ = away < band_ ? free_s_ + dt : 0;
  if (free_s_ == 0) band_ = std::min(0.15, band_ + std::max(2e-4, 1.25 * fastest_) * dt);
  if (free_s_ > 1) {
    band_ = std::max(0.03, std::min(band_, 1.25 * away));
    const double share = std::min(1.0, dt / time_constant_s_);
    fastest_ = 0;
    for (std::size_t s = 0; s < signals.size(); ++s) {
      if (std::isnan(mean_[s])) continue;
      const double lag = mean_[s] - rest_[s];
      rest_[s] += share * lag;
      rate_[s] += share * (lag / time_constant_s_ - rate_[s]);
      fastest_ = std::max(fastest_, std::abs(rate_[s] / scale_.span));
    }
  }
  for (std::size_t s = 0; s < signals.size(); ++s)
    signals[s] = static_cast<float>(double{signals[s]} - rest_[s] + scale_.rest);
}

std::vector<double> rests_between_touches(std::span<const std::vector<float>> signals, int channels,
                                          bool rises) {
  const std::size_t frames = signals.empty() ? 0 : signals.front().size();
  std::vector<double> total(frames), steps;
  for (const std::vector<float>& signal : signals) {
    std::vector<float> values = signal;
    const double middle = frames > 0 ? double{median(values)} : 0;
    for (std::size_t f = 0; f < frames; ++f) {
      const double away = double{signal[f]} - middle;
      total[f] += channels > 1 ? std::abs(away) : rises ? away : -away;
    }
  }
  for (std::size_t f = 1; f < frames; ++f) steps.push_back(std::abs(total[f] - total[f - 1]));
  std::vector<double> sorted = total;
  // A quarter of the differences of two normal numbers are below 0.4506 deviations.
  const double noise = steps.empty() ? 0 : quantile(steps, 0.25) / 0.4506;
  const double most = frames > 0 ? quantile(sorted, 0.1) + 4 * noise : 0;
  std::vector<double> rests;
  for (const std::vector<float>& signal : signals) {
    std::vector<float> free;
    for (std::size_t f = 0; f < frames; ++f)
      if (total[f] <= most) free.push_back(signal[f]);
    rests.push_back(free.empty() ? 0 : double{median(free)});
  }
  return rests;
}

}  // namespace supertac
