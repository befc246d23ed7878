#include "apps/stream/raw_array.h"

#include <algorithm>
#include <cmath>

namespace supertac {

RawArray::RawArray(const SensorSource& source)
    : array_(source.array()),
      direction_(source.signal_scale().rises() ? 1 : -1),
      period_s_(source.period_s()),
      least_top_(kLeastTop * std::abs(source.signal_scale().span)),
      top_(least_top_),
      rest_(array_.signals()),
      newest_mean_(array_.signals()),
      newest_(array_.signals()) {}

// The beginning is taken for rest, as a mean that settles within kRestS.
void RawArray::push(std::span<const float> signals) {
  newest_.assign(signals.begin(), signals.end());
  ++frames_;
  const double share = std::max(1.0 / static_cast<double>(frames_), std::min(1.0, period_s_ / kRestS));
  const bool settling = static_cast<double>(frames_) * period_s_ <= kRestS || frames_ == 1;
  for (std::size_t s = 0; s < newest_.size(); ++s) {
    if (!std::isfinite(newest_[s])) continue;
    newest_mean_[s] += share * (double{newest_[s]} - newest_mean_[s]);
    if (settling) rest_[s] = newest_mean_[s];
  }
  if (settling) return;
  top_ = std::max(least_top_, top_ * (1 - std::min(1.0, period_s_ / kForgetS)));
  for (std::size_t k = 0; k < static_cast<std::size_t>(array_.taxels()); ++k)
    top_ = std::max(top_, pressed(k));
}

double RawArray::pressed(std::size_t taxel) const {
  const auto channels = static_cast<std::size_t>(array_.channels);
  double sum = 0, squares = 0;
  for (std::size_t c = 0; c < channels; ++c) {
    const std::size_t s = taxel * channels + c;
    const double change = std::isfinite(newest_[s]) ? double{newest_[s]} - rest_[s] : 0;
    sum += direction_ * change, squares += change * change;
  }
  return channels == 3 ? std::sqrt(squares) : std::max(0.0, sum / static_cast<double>(channels));
}

std::optional<ChangedSignal> RawArray::most_changed() const {
  std::optional<ChangedSignal> most;
  double farthest = least_top_;
  for (std::size_t s = 0; s < newest_.size(); ++s) {
    const double change = std::abs(double{newest_[s]} - rest_[s]);
    if (!(change > farthest)) continue;  // nor where it is no number
    farthest = change;
    const int signal = static_cast<int>(s);
    most = {signal / array_.channels, signal % array_.channels, rest_[s], double{newest_[s]}};
  }
  return most;
}

std::vector<double> RawArray::loads() const {
  std::vector<double> loads(static_cast<std::size_t>(array_.taxels()));
  for (std::size_t s = 0; s < rest_.size(); ++s) {
    double& load = loads[s / static_cast<std::size_t>(array_.channels)];
    load = std::hypot(load, newest_mean_[s] - rest_[s]);
  }
  return loads;
}

std::vector<float> RawArray::taxels() const {
  std::vector<float> values(static_cast<std::size_t>(array_.taxels()));
  for (std::size_t k = 0; k < values.size(); ++k)
    values[k] = static_cast<float>(std::min(1.0, pressed(k) / top_));
  return values;
}

}  // namespace supertac
