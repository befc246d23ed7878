#include "data/clock/frame_clock.h"

#include <algorithm>
#include <cmath>

#include "io/numbers/median.h"

namespace supertac {

using namespace clock_model;

ClockSettings clock_settings(const Sensor& sensor, bool stored) {
  ClockSettings settings{
      .period_s = 1 / sensor.rate_hz,
      .tolerance = sensor.frame.kind == FrameKind::board ? 0.005 : 20,  // a stated rate may be 21 times off
      .stored = stored};
  if (sensor.frame.kind == FrameKind::board) settings.period_s = rig::kFramePeriodS;
  if (!sensor.frame.time) return settings;
  const std::string& type = sensor.frame.time->type;
  settings.stamp_unit_s = sensor.frame.time->unit_s;
  // millis() and micros() of lines and JSON have 32 bits.
  const double bits = type == "u16" ? 16 : type == "u64" ? 64 : type == "f64" ? 0 : 32;
  if (bits > 0 && !(type.empty() && settings.stamp_unit_s == 1))
    settings.stamp_range_s = std::exp2(bits) * settings.stamp_unit_s;
  return settings;
}

FrameClock::FrameClock(const ClockSettings& settings)
    : settings_(settings),
      rate_{settings.period_s, settings.tolerance},
      measured_s_(settings.period_s),
      stamps_(settings) {}

// Of equal ones the newest.
const ReadEnd& FrameClock::lowest() const {
  return *std::ranges::min_element(window_.rbegin(), window_.rend(), {},
                                   [this](const ReadEnd& burst) { return level(burst); });
}

// By so much (s) the earliest of the last reads may have been late.
double FrameClock::jitter_s() const {
  return late_.known ? late_.jitter_s : settings_.stamp_unit_s > 0 ? settings_.stamp_unit_s : kOldestS;
}

void FrameClock::take(double first, double last, double time_s) {
  add_read(window_, {.first = first, .last = last, .time_s = time_s}, shortest(rate_));
  const double span = span_s(late_.jitter_s, settings_.stamp_unit_s);
  while (window_.size() > kReads + 1 && time_s - window_[1].time_s >= span) {
    ReadEnd& end = ends_.emplace_back(window_.front());
    end.first += static_cast<double>(lost_), end.last += static_cast<double>(lost_);
    window_.pop_front();
    if (++ended_ % kReads == 0) learn();
  }
  count_lost();
}

// By so many periods the reads behind the envelope's last point are late: as many of them as say so for good,
// of those that are near it, over which the clock wanders least.
double FrameClock::periods_lost() const {
  const double period = rate_.period_s, unsure = rate_.uncertain * period;
  double rise = kNever, least = kNever;
  std::size_t reads = 0;
  auto read = std::ranges::upper_bound(window_, level_last_, {}, &ReadEnd::last);
  for (const double begin_s = read == window_.end() ? 0 : read->time_s; read != window_.end(); ++read) {
    rise = std::min(rise, level(*read) - level_s_);
    least = std::min(least, level(*read) - level_s_ - unsure * (read->last - level_last_));
    if (least <= 0.5 * period + grain(settings_.stamp_unit_s, period)) return 0;
    if (for_good(++reads, read->time_s - begin_s, least, jitter_s())) return std::round(rise / period);
  }
  return 0;
}

// The envelope stays late by whole periods: frames were lost; unless it comes back.
void FrameClock::count_lost() {
  if (window_.empty()) return;
  const ReadEnd low = lowest();
  const double low_s = level(low), rise = low_s - level_s_, period = rate_.period_s;
  // Until it is known how late frames come, what a known rate has lost is put off.
  if (levelled_ && rise > 0 && !late_.known && settings_.tolerance < kKnown) return;
  if (levelled_ && rise > 0.5 * period) lost_ += static_cast<std::uint64_t>(periods_lost());
  if (levelled_ && rise < -0.5 * period)
    lost_ -= std::min(lost_, static_cast<std::uint64_t>(std::lround(-rise / period)));
  level_s_ = low_s, level_last_ = low.last, levelled_ = true;
}

void FrameClock::learn() {
  if (ends_.size() > 512) ends_.erase(ends_.begin(), ends_.end() - 256);
  Rate found = slope_of(ends_, rate_.period_s, 0.125, settings_.stamp_unit_s);
  const double off = found.period_s / settings_.period_s,
               differs = std::abs(found.period_s / rate_.period_s - 1);
  if (found.uncertain >= kNever || off > 1 + settings_.tolerance || off < 1 / (1 + settings_.tolerance))
    return;
  found.uncertain = std::min(2 * settings_.tolerance, found.uncertain);
  late_ = lateness_of(ends_, found, span_s(late_.jitter_s, settings_.stamp_unit_s));
  // Live, lost frames stand in the rate until they are told.
  if (settings_.stamp_unit_s <= 0)
    found = doubted(found, settings_.period_s, settings_.tolerance, jitter_s());
  // The period stays where it may, and is as far off as from where it was found.
  const bool stays = differs <= found.uncertain;
  rate_.uncertain = std::min(2 * settings_.tolerance, found.uncertain + (stays ? differs : 0));
  measured_s_ = found.period_s;
  if (stays) return;
  rate_.period_s = found.period_s;
  // What was the median of levels by quite another period is none by this.
  if (settings_.stamp_unit_s > 0 && differs > 0.25) window_.clear();
  levelled_ = false;
}

void FrameClock::finish() {
  while (window_.size() > 1) {
    window_.pop_front();
    count_lost();
  }
}

FrameDate FrameClock::dated(double due_s, double from_s, double to_s) {
  FrameDate date{.from_s = std::min(from_s, to_s), .to_s = to_s, .missing = missing()};
  date.time_s = std::clamp(due_s, date.from_s, date.to_s);
  if (!first_ && date.time_s <= last_.time_s) {
    date.time_s =
        std::max(last_.time_s + 1e-3 * rate_.period_s, std::nextafter(last_.time_s, kNever * kNever));
    date.to_s = std::max(date.to_s, date.time_s);
  }
  first_ = false;
  return last_ = date;
}

void FrameClock::date(std::span<const FrameArrival> frames, std::vector<FrameDate>& dates) {
  dates.clear();
  if (frames.empty()) return;
  const double time_s = frames.front().time_s, first = number_ + 1 + frames.front().damaged;
  if (settings_.stamp_unit_s > 0 || settings_.stored) {
    for (const FrameArrival& frame : frames) {
      dates.push_back(by_stamp(frame));
      arrived_s_ = time_s;
    }
    return;
  }
  double last = number_;
  for (const FrameArrival& frame : frames) last += 1 + frame.damaged, damaged_ += frame.damaged;
  // What came before this read, that one at least of it was on time. By the rate that was known then.
  const double period = rate_.period_s;
  const double drift = rate_.uncertain * rate_.period_s, front = first_ ? 0 : window_.front().last;
  const double low_s = first_ ? -kNever : level(lowest()) - jitter_s();
  take(first, last, time_s);
  const double least = shortest(rate_), waited_s = late_.known ? late_.waited_s : 2 * kOldestS;
  for (const FrameArrival& frame : frames) {
    const double step = 1 + frame.damaged, to_s = time_s - least * (last - (number_ + step));
    number_ += step;
    double from_s = low_s + period * number_ - drift * (number_ - front);
    if (window_.size() > 1)
      from_s = std::max(
          from_s, window_[window_.size() - 2].time_s - waited_s + least * (number_ - window_.back().first));
    from_s = std::max(from_s, first_ ? time_s - kOldestS : last_.from_s + least * step);
    dates.push_back(dated(first_ ? to_s : last_.time_s + rate_.period_s * step, from_s, to_s));
  }
}

// Two stamps in a row may be wrong: the median of five is an arrival.
void FrameClock::take_stamp() {
  if (stamped_.size() < 2 * kWitnesses - 1) return;
  std::vector<double> levels;
  for (std::size_t k = 1; k < 2 * kWitnesses; ++k) levels.push_back(level(stamped_[stamped_.size() - k]));
  const double number = stamped_[stamped_.size() - kWitnesses].last;
  take(number, number, median(levels) + rate_.period_s * number + settings_.stamp_unit_s);
}

FrameDate FrameClock::by_stamp(const FrameArrival& frame) {
  const double step = 1 + frame.damaged, period = rate_.period_s;
  const double elapsed_s = first_ ? 0 : frame.time_s - arrived_s_;
  damaged_ += frame.damaged, number_ += step;
  const DeviceStamps::Reading reading =
      frame.stamp_s ? stamps_.read(*frame.stamp_s, elapsed_s, rate_) : DeviceStamps::Reading{};
  settings_.stamp_unit_s = stamps_.unit_s();
  const double unit = settings_.stamp_unit_s;
  const double due = first_ ? 0 : last_.time_s + period * step;
  if (unit <= 0) return dated(due, due, due);  // stored, without stamps
  const double farthest_s = settings_.stored ? due + period * step : stamps_.latest_s() + kOldestS;
  if (!reading.time_s && first_) return dated(0, -kMostStampS, kMostStampS);
  if (!reading.time_s) return dated(due, last_.from_s, std::max(due + unit, farthest_s));
  resets_ += reading.reset ? 1 : 0;
  if (reading.anew) window_.clear(), stamped_.clear(), levelled_ = false;
  const double stamp_s = *reading.time_s, longest = period * (1 + rate_.uncertain);
  const double least_s = first_ || reading.anew ? stamp_s - unit - std::abs(stamp_s - believed_s_)
                                                : last_.from_s + shortest(rate_) * step;
  believed_s_ = stamp_s;
  stamped_.push_back({.last = number_, .time_s = stamp_s, .gap_s = frame.time_s - stamp_s});
  if (stamped_.size() > kReads) stamped_.pop_front();
  take_stamp();
  if (first_) return dated(stamp_s, -kMostStampS, kMostStampS);
  // Of this stamp and the two before, their frames later, one is right. Where they say other things by more
  // than their unit, or this one arrives later than those before, it may be as wrong as the dates before it
  // and its arrival allow.
  double from_s = kNever, to_s = -kNever;
  bool fits = stamped_.size() >= kWitnesses;
  for (std::size_t k = 1; k <= std::min(kWitnesses, stamped_.size()); ++k) {
    const ReadEnd& one = stamped_[stamped_.size() - k];
    const double least = one.time_s + shortest(rate_) * (number_ - one.last),
                 most = one.time_s + longest * (number_ - one.last) + unit;
    fits = fits && stamp_s >= least - unit && stamp_s <= most;
    from_s = std::min(from_s, least), to_s = std::max(to_s, most);
  }
  const bool late = std::ranges::max_element(stamped_, {}, &ReadEnd::gap_s) == stamped_.end() - 1 &&
                    stamps_.latest_s() - stamp_s > 0.5 * period;
  if (!fits) from_s = least_s, to_s = std::max(to_s, farthest_s);
  if (!settings_.stored && (late || rate_.uncertain >= kKnown)) to_s = std::max(to_s, stamps_.latest_s());
  const bool coarse = unit > 0.25 * period;
  return dated(coarse ? std::clamp(due, stamp_s, stamp_s + unit) : stamp_s, from_s, to_s);
}

}  // namespace supertac
