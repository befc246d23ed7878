#include "data/clock/frame_clock.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "data/clock/clock_model.h"
#include "io/numbers/median.h"

namespace supertac {

using namespace clock_model;

Rate clock_model::slope_of(std::span<const ReadEnd> ends, double period_s, double farthest) {
  const std::size_t each = std::clamp<std::size_t>(ends.size() / 16, 1, 8), blocks = ends.size() / each;
  std::vector<ReadEnd> points;
  for (std::size_t b = 0; b < blocks; ++b)
    points.push_back(std::ranges::min(ends.subspan(b * each, each), {}, [period_s](const ReadEnd& end) {
      return end.time_s - period_s * end.last;
    }));
  Rate best{period_s, kNever, 1};
  std::vector<double> found;
  double surest = kNever;
  double slow = 0;  // what the envelope wanders by, as a share of the whole
  const double reach = std::max(1.0, farthest * static_cast<double>(blocks));
  for (std::size_t apart = 1; static_cast<double>(apart) <= reach; apart *= 2) {
    std::vector<double> slopes, off;
    for (std::size_t b = 0; b + apart < points.size(); ++b)
      slopes.push_back((points[b + apart].time_s - points[b].time_s) /
                       (points[b + apart].last - points[b].last));
    if (slopes.size() < 4) break;
    const double slope = median(slopes), count = static_cast<double>(slopes.size());
    for (const double s : slopes) off.push_back(std::abs(s - slope));
    const double share = median(off) / slope, shorter = 1 - quantile(slopes, 0.02) / slope;
    const double uncertain =
        std::max({kSteady, shorter, kSure * share * (1 + 16 / count) / std::sqrt(count)});
    slow = std::max(slow, kSure * share * static_cast<double>(apart) / static_cast<double>(blocks));
    // What was lost makes a slope longer, never shorter.
    if (slope > 0 && slope * (1 + uncertain) < surest)
      best = {slope, uncertain, 1}, surest = slope * (1 + uncertain);
    found.push_back(slope);
  }
  best.uncertain = std::max(best.uncertain, slow);
  for (const double slope : found)
    best.uncertain = std::max(best.uncertain, 1.5 * (1 - slope / best.period_s));
  best.wanders = std::min(best.uncertain, 1.0);
  return best;
}

ClockSettings clock_settings(const Sensor& sensor, bool stored) {
  ClockSettings settings{.period_s = 1 / sensor.rate_hz,
                         .tolerance = sensor.frame.kind == FrameKind::board ? 0.005 : kAnyRate,
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
      rate_{settings.period_s, settings.tolerance, std::min(settings.tolerance, 1.0)},
      measured_s_(settings.period_s),
      stamps_(settings),
      most_waited_s_(settings.stamp_unit_s > 0 ? 0 : kOldestS) {}

void FrameClock::keep_low(const ReadEnd& burst) {
  while (!lows_.empty() && (lows_.back().burst == closed_ || lows_.back().level_s >= level(burst)))
    lows_.pop_back();
  lows_.push_back({closed_, level(burst), burst.last});
}

// By so much (s) the earliest of the last reads may have been late.
double FrameClock::jitter_s() const {
  return !late_known_ ? (settings_.stamp_unit_s > 0 ? settings_.stamp_unit_s : kOldestS) : jitter_of_late_s_;
}

void FrameClock::take(double first, double last, double time_s) {
  const bool joins = !window_.empty() && (time_s == window_.back().time_s ||
                                          waited_before(last - window_.back().last,
                                                        time_s - window_.back().time_s, shortest(rate_)));
  if (joins) {
    window_.back().last = last, window_.back().time_s = time_s;
  } else {
    window_.push_back({first, last, time_s, window_.empty() ? 0 : time_s - window_.back().time_s});
    ++closed_;
  }
  keep_low(window_.back());
  const double span = !late_known_ ? kReadsS : span_s(jitter_s());
  while (window_.size() > kReads + 1 && time_s - window_[1].time_s >= span) drop_front();
  count_lost();
}

void FrameClock::drop_front() {
  const ReadEnd burst = window_.front();
  const double low_s =
      lows_.front().level_s - rate_.wanders * rate_.period_s * (window_.back().last - burst.last);
  if (late_s_.empty()) late_since_s_ = burst.time_s;
  late_s_.push_back(level(burst) - low_s);
  if (late_s_.size() > kMostEnds) late_s_.erase(late_s_.begin(), late_s_.end() - kMostEnds / 2);
  // Reads that come at once are late together: they must go on for a while.
  if (late_s_.size() >= kReads && burst.time_s - late_since_s_ >= kReadsS &&
      (!late_known_ || late_s_.size() % kReads == 0)) {
    std::vector<double> sorted = late_s_;
    jitter_of_late_s_ = quantile(sorted, kLateShare), late_known_ = true;
  }
  const double waited_s = burst.time_s - rate_.period_s * burst.first - low_s - burst.gap_s;
  if (late_s_.size() == kEnough && most_waited_s_ == kOldestS) most_waited_s_ = 0;
  if (late_s_.size() >= kEnough) most_waited_s_ = std::max({most_waited_s_, waited_s, jitter_s()});
  window_.pop_front();
  if (lows_.front().burst == closed_ - window_.size()) lows_.pop_front();
  ends_.push_back(burst);
  ends_.back().last += static_cast<double>(lost_);
  ++ended_;
  const bool due = ended_ % 64 == 0 || (ended_ < 64 && ended_ >= kReads && std::has_single_bit(ended_));
  if (due) learn();
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
    if (least <= kWholePeriod * period + grain(settings_.stamp_unit_s, period)) return 0;
    if (for_good(++reads, read->time_s - begin_s, least, jitter_s())) return std::round(rise / period);
  }
  return 0;
}

// The envelope stays late by whole periods: frames were lost; unless it comes back.
void FrameClock::count_lost() {
  const double low_s = lows_.front().level_s, rise = low_s - level_s_, period = rate_.period_s;
  // Until it is known how late frames come, what a known rate has lost is put off.
  if (levelled_ && rise > 0 && !late_known_ && settings_.tolerance < kKnown) return;
  if (levelled_ && rise > kWholePeriod * period) lost_ += static_cast<std::uint64_t>(periods_lost());
  if (levelled_ && rise < -kWholePeriod * period)
    lost_ -= std::min(lost_, static_cast<std::uint64_t>(std::lround(-rise / period)));
  level_s_ = low_s, level_last_ = lows_.front().last, levelled_ = true;
}

void FrameClock::learn() {
  if (ends_.size() > kMostEnds) ends_.erase(ends_.begin(), ends_.end() - kMostEnds / 2);
  Rate found = slope_of(ends_, rate_.period_s, 0.125);
  const double off = found.period_s / settings_.period_s,
               differs = std::abs(found.period_s / rate_.period_s - 1);
  if (found.uncertain >= kNever || off > 1 + settings_.tolerance || off < 1 / (1 + settings_.tolerance))
    return;
  // What was late by a rate that nobody knew says little. Live, lost frames stand in the rate until they are
  // told.
  if (found.uncertain < 0.5 * rate_.uncertain) late_s_.clear();
  if (settings_.stamp_unit_s <= 0) found = doubted(found, settings_, jitter_s());
  rate_.uncertain = std::min(2 * settings_.tolerance, found.uncertain);
  rate_.wanders = std::min(2 * settings_.tolerance, found.wanders / kSureToLikely),
  measured_s_ = found.period_s;
  if (differs <= found.uncertain) return;
  rate_.period_s = found.period_s;
  lows_.clear();
  const std::uint64_t closed = std::exchange(closed_, closed_ - window_.size());
  for (const ReadEnd& burst : window_) ++closed_, keep_low(burst);
  closed_ = closed;
  levelled_ = false;
}

void FrameClock::finish() {
  while (window_.size() > 1) {
    window_.pop_front();
    if (lows_.front().burst == closed_ - window_.size()) lows_.pop_front();
    count_lost();
  }
}

FrameDate FrameClock::dated(double due_s, double from_s, double to_s) {
  FrameDate date{.from_s = std::min(from_s, to_s), .to_s = to_s, .missing = missing()};
  date.time_s = std::clamp(due_s, date.from_s, date.to_s);
  if (!first_ && date.time_s <= last_.time_s) {
    date.time_s = last_.time_s + 1e-3 * rate_.period_s;
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
  const double low_s = first_ ? -kNever : lows_.front().level_s - jitter_s();
  take(first, last, time_s);
  const double least = shortest(rate_);
  for (const FrameArrival& frame : frames) {
    const double step = 1 + frame.damaged, to_s = time_s - least * (last - (number_ + step));
    number_ += step;
    double from_s = low_s + period * number_ - drift * (number_ - front);
    if (window_.size() > 1)
      from_s = std::max(from_s, window_[window_.size() - 2].time_s - 2 * most_waited_s_ +
                                    least * (number_ - window_.back().first));
    from_s = std::max(from_s, first_ ? time_s - kOldestS : last_.from_s + least * step);
    dates.push_back(dated(first_ ? to_s : last_.time_s + rate_.period_s * step, from_s, to_s));
  }
}

FrameDate FrameClock::by_stamp(const FrameArrival& frame) {
  const double step = 1 + frame.damaged, period = rate_.period_s;
  const double elapsed_s = first_ ? 0 : frame.time_s - arrived_s_;
  damaged_ += frame.damaged, number_ += step, unbelieved_s_ += settings_.stored ? 0 : elapsed_s;
  const DeviceStamps::Reading reading =
      frame.stamp_s ? stamps_.read(*frame.stamp_s, elapsed_s, period) : DeviceStamps::Reading{};
  settings_.stamp_unit_s = stamps_.unit_s();
  const double unit = settings_.stamp_unit_s;
  if (!reading.time_s) {
    if (first_) return dated(0, 0, 0);
    const double due = last_.time_s + period * step;
    if (!frame.stamp_s) return dated(due, due, due);  // stored, without stamps
    return dated(due, last_.from_s, std::max(due + period * step, believed_s_ + unbelieved_s_ + kOldestS));
  }
  resets_ += reading.reset ? 1 : 0;
  if (reading.anew) window_.clear(), lows_.clear(), levelled_ = false;
  const double stamp_s = *reading.time_s, went = stamp_s - std::exchange(believed_s_, stamp_s);
  const double off = first_ ? 0 : went - period * (number_ - believed_number_);
  const bool coarse = unit > 0.25 * period;
  believed_number_ = number_, unbelieved_s_ = 0;
  if (coarse || off > -0.5 * period) take(number_, number_, stamp_s + unit);
  const double due = coarse && !first_ ? last_.time_s + period * step : stamp_s;
  const double unsure = std::min(rate_.uncertain, 1.0) * std::abs(went);
  // The stamp before says by how much this one is off, up to a unit, and whole periods may have been lost.
  const double too_early = off > 0 ? std::abs(off - period * std::round(off / period)) : -off;
  return dated(std::clamp(due, stamp_s, stamp_s + (coarse ? unit : 0)),
               stamp_s - std::max(0.0, off) - unit - unsure, stamp_s + 2 * unit + too_early + unsure);
}

}  // namespace supertac
