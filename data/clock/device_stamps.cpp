#include "data/clock/device_stamps.h"

#include <algorithm>
#include <cmath>

#include "data/clock/clock_model.h"

namespace supertac {

using namespace clock_model;

double finer_unit(double stamp_s, double unit_s) {
  const auto left = [&] { return std::abs(std::remainder(stamp_s / unit_s, 1)); };  // as far as rounding goes
  if (std::abs(stamp_s) >= kMostStampS) return unit_s;
  while (unit_s > 1e-9 && left() > 1e-3 + 1e-15 * std::abs(stamp_s / unit_s)) unit_s /= 10;
  return unit_s;
}

double DeviceStamps::latest_s() const { return now_s_ - head_.least_lag_s + 2 * kClockDrifts * elapsed_s_; }

double DeviceStamps::step_from(const Mark& one, double raw_s, double most_s) const {
  const double step = raw_s - one.raw_s, range = settings_.stamp_range_s, elapsed_s = now_s_ - one.arrived_s;
  if (range <= 0) return step;
  const double times = elapsed_s > 0.5 * range ? std::round((elapsed_s - step) / range) : step < 0 ? 1 : 0;
  const double on = step + range * times;
  // A clock that has run over says what has passed since; one that started anew says anything.
  return times > 0 && (on > most_s || elapsed_s - on > range / 16) ? step : on;
}

// The longest chain of stamps that this one can follow.
DeviceStamps::Mark DeviceStamps::chained(double raw_s, const Rate& rate) const {
  Mark mark{.raw_s = raw_s,
            .arrived_s = now_s_,
            .least_lag_s = now_s_ - raw_s,
            .number = number_,
            .root = number_,
            .length = 1};
  for (const Mark& one : marks_) {
    // As late as the frames are, so far may a stamp be ahead.
    const double most =
        settings_.stored ? 10 * rate.period_s : now_s_ - one.time_s() - one.least_lag_s + kOldestS;
    const double step = step_from(one, raw_s, most);
    const bool as_far = settings_.stored && one.number == number_ - 1 && step > 0 &&
                        std::abs(step - one.step_s) < 0.5 * one.step_s;
    if (one.number == number_ - 1) mark.step_s = step;
    const double least = shortest(rate) * static_cast<double>(number_ - one.number) - settings_.stamp_unit_s;
    if (step < least || (step > most && !as_far) || one.length + 1 < mark.length) continue;
    mark.off_s = one.off_s + (step - (raw_s - one.raw_s));
    mark.before = one.number, mark.root = one.root, mark.length = one.length + 1;
    mark.least_lag_s =
        std::min(one.least_lag_s + kClockDrifts * (now_s_ - one.arrived_s), now_s_ - mark.time_s());
  }
  return mark;
}

DeviceStamps::Reading DeviceStamps::read(double stamp_s, double elapsed_s, const Rate& rate) {
  if (!settings_.stored) now_s_ += elapsed_s_ = elapsed_s;
  ++number_;
  if (!(std::abs(stamp_s) < kMostStampS)) return {};
  settings_.stamp_unit_s = finer_unit(stamp_s, settings_.stamp_unit_s);
  Mark mark = chained(stamp_s, rate);
  Reading reading;
  const bool goes_on = mark.root == head_.root || head_.number == 0;
  const bool other = !goes_on && mark.length >= kWitnesses;
  const bool believed = other || (goes_on && mark.length >= head_.length);
  marks_.push_back(mark);
  if (other) {
    const Mark& root = *std::ranges::find(marks_, mark.root, &Mark::root);
    const double ahead_s = root.raw_s - head_.raw_s;
    const bool paused = settings_.stored && ahead_s > 0;
    reading.reset = !paused && head_.length > 1, reading.anew = !paused;
    const double since_s = paused ? ahead_s
                                  : std::max(root.arrived_s - head_.arrived_s,
                                             rate.period_s * (static_cast<double>(root.number) -
                                                              static_cast<double>(head_.number)));
    const double off_s = head_.time_s() + since_s - root.time_s();
    // Its first stamp may have waited as long as the last of the chain before had.
    const double waited_s = head_.arrived_s - head_.time_s() - head_.least_lag_s;
    for (Mark& one : marks_)
      if (one.root == mark.root) one.off_s += off_s, one.least_lag_s -= off_s + waited_s;
    mark = marks_.back();
  }
  if (believed && mark.before != head_.number) {
    std::uint64_t on = mark.number;
    for (std::size_t k = marks_.size(); k-- > 0;) {
      const Mark& one = marks_[k];
      const bool is_on = one.number == on;
      if (is_on) on = one.before;
      if (is_on || one.root == mark.root)
        reading.revised.push_back({number_ - one.number, is_on ? std::optional(one.time_s()) : std::nullopt});
    }
  }
  if (believed) head_ = mark, reading.time_s = mark.time_s();
  std::erase_if(marks_, [&](const Mark& one) {
    return one.number + kWitnesses <= number_ && one.number != head_.number;
  });
  return reading;
}

}  // namespace supertac
