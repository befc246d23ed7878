#include "data/frames/frame_clock.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "io/numbers/median.h"

namespace supertac {
namespace {

// The assumptions of the header.
constexpr std::size_t kReads = 16;
constexpr double kReadsS = 0.25, kSteady = 2e-4, kLate = 3;
constexpr double kOldestS = 0.6;  // a frame waited no longer before anything is known; stamps jump no farther
constexpr double kAnyRate = 20;   // of a rate that is a word
constexpr double kWholePeriod = 0.7;  // what is late by less may be late alone
constexpr double kNever = 1e9, kMostStampS = 1e11;
constexpr std::size_t kMostEnds = 512;
constexpr double kSure = 18;           // median deviations
constexpr std::size_t kEnough = 64;    // reads that show how late frames come
constexpr double kKnown = 0.05;        // a rate that is surer tells what was lost
constexpr std::size_t kFew = 3;        // reads at the end, which are late alone
constexpr double kStoredJumpS = 0.1;   // of stamps in a file, where no arrival bears a longer one out
constexpr double kClockDrifts = 0.01;  // at most, from the port's
constexpr double kClockOff = 0.5;      // of a device's clock from the port's, as a share

// Whether these frames, which came so long after a read that had emptied the port, are more than can have
// been made since: then they had waited, too, and belong to that read.
bool waited_before(double frames, double seconds, double period_s) {
  return frames - seconds / period_s > 0.5 + 0.02 * frames;
}

// The period, as the earliest of every few reads tell it: the median slope between two that lie as far apart
// as makes it surest. A loss spoils the slopes across it only, so that they may not lie too far apart.
Rate slope_of(std::span<const ReadEnd> ends, double period_s, double farthest) {
  const std::size_t each = std::clamp<std::size_t>(ends.size() / 16, 1, 8), blocks = ends.size() / each;
  std::vector<ReadEnd> points;
  for (std::size_t b = 0; b < blocks; ++b)
    points.push_back(std::ranges::min(ends.subspan(b * each, each), {}, [period_s](const ReadEnd& end) {
      return end.time_s - period_s * end.last;
    }));
  Rate best{period_s, kNever};
  std::vector<double> found;
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
    const double uncertain = std::max({kSteady, shorter, kSure * share / std::sqrt(count)});
    slow = std::max(slow, kSure * share * static_cast<double>(apart) / static_cast<double>(blocks));
    if (slope > 0 && uncertain < best.uncertain) best = {slope, uncertain};
    found.push_back(slope);
  }
  best.uncertain = std::max(best.uncertain, slow);
  // Many losses are a longer period to slopes over long ways only.
  for (const double slope : found)
    best.uncertain = std::max(best.uncertain, 1.5 * std::abs(slope / best.period_s - 1));
  return best;
}

// As short as the period may be.
double shortest(const Rate& rate) { return rate.period_s * (1 - std::min(rate.uncertain, 0.95)); }

/// A whole recording's envelope: for every frame the interval of its time, and what was lost before it.
struct Tube {
  std::vector<double> from, to, dates;
  std::vector<std::uint64_t> lost;
  Rate rate{0, 0};
  double measured_s = 0;
  bool plausible = true;
};

class TubeMaker {
 public:
  /// `y`: NaN where a frame has no witness, which is no later than `width_s`. `slack`: by so much x may be
  /// too large.
  TubeMaker(std::span<const double> x, std::span<const double> y, double width_s, double period_s,
            double tolerance, std::span<const double> slack = {})
      : x_(x), y_(y), slack_(slack), width_s_(width_s), nominal_s_(period_s), tolerance_(tolerance) {}

  Tube make() {
    rate_ = {nominal_s_, tolerance_};
    gather(false);
    // First with what was lost in it, then without.
    for (const double farthest : {0.125, 0.5}) {
      find_rate(farthest);
      gather(true);
      find_levels();
    }
    tube_.rate = rate_;
    find_intervals();
    return std::move(tube_);
  }

 private:
  void gather(bool merged) {
    bursts_.clear();
    for (std::size_t i = 0; i < x_.size(); ++i) {
      if (std::isnan(y_[i])) continue;
      const double before = bursts_.empty() ? y_[i] : bursts_.back().time_s;
      const bool joins =
          !bursts_.empty() && (y_[i] == before || (merged && waited_before(x_[i] - bursts_.back().last,
                                                                           y_[i] - before, shortest(rate_))));
      if (!joins) bursts_.push_back({.first = x_[i], .gap_s = y_[i] - before});
      bursts_.back().last = x_[i], bursts_.back().time_s = y_[i], bursts_.back().slack_s = slack(i);
    }
  }

  void find_rate(double farthest) {
    std::vector<ReadEnd> ends = bursts_;
    for (std::size_t b = 0; b < ends.size() && b < lost_.size(); ++b)
      ends[b].time_s -= rate_.period_s * lost_[b];
    Rate found = slope_of(ends, rate_.period_s, farthest);
    found = slope_of(ends, found.period_s, farthest);
    const double off = found.period_s / nominal_s_;
    tube_.plausible = off <= 1 + tolerance_ && off >= 1 / (1 + tolerance_);
    tube_.measured_s = found.period_s;
    if (found.uncertain >= kNever || !tube_.plausible) found = {nominal_s_, tolerance_};
    rate_ = found;
  }

  double slack(std::size_t i) const { return slack_.empty() ? 0 : slack_[i]; }
  double level(const ReadEnd& burst) const {
    return burst.time_s + burst.slack_s - rate_.period_s * burst.last;
  }

  // The highest line with this rate under all arrivals that follow, and its steps.
  void find_levels() {
    levels_.assign(bursts_.size(), 0);
    lost_.assign(bursts_.size(), 0);
    jitter_s_ = 0;
    const double drift = rate_.uncertain * rate_.period_s;
    const std::size_t count = bursts_.size();
    // How late a read is against the earliest of its window, the rate being as unlucky as may be.
    std::deque<std::size_t> lows;
    const auto falling = [&](std::size_t b) { return level(bursts_[b]) - drift * bursts_[b].last; };
    std::size_t whole = 0, ahead = count;
    for (std::size_t b = count; b-- > 0;) {
      levels_[b] = level(bursts_[b]);
      if (b + 1 < count)
        levels_[b] = std::min(levels_[b], levels_[b + 1] + drift * (bursts_[b + 1].last - bursts_[b].last));
      while (!lows.empty() && falling(lows.back()) >= falling(b)) lows.pop_back();
      lows.push_back(b);
      while (ahead > b + 1 + kReads && bursts_[ahead - 2].time_s - bursts_[b].time_s >= kReadsS) --ahead;
      while (lows.front() >= ahead) lows.pop_front();
      if (ahead - b <= kReads || bursts_[ahead - 1].time_s - bursts_[b].time_s < kReadsS) continue;
      jitter_s_ += falling(b) - falling(lows.front()), ++whole;
    }
    jitter_s_ =
        whole < kReads ? std::min(kOldestS, width_s_) : kLate * jitter_s_ / static_cast<double>(whole);
    most_waited_s_ = jitter_s_;
    for (std::size_t b = 1; b < count; ++b) {
      const double rise = levels_[b] - levels_[b - 1],
                   behind = static_cast<double>(std::min(count - b, kReads));
      const bool sure = rate_.uncertain < kKnown && rise > kWholePeriod * rate_.period_s && behind >= kFew &&
                        behind * rise > kReads * jitter_s_;
      lost_[b] = lost_[b - 1] + (sure ? std::round(rise / rate_.period_s) : 0);
      most_waited_s_ = std::max(most_waited_s_, bursts_[b].time_s - rate_.period_s * bursts_[b].first -
                                                    levels_[b] - bursts_[b].gap_s);
    }
  }

  void find_intervals() {
    const std::size_t n = x_.size();
    tube_.from.assign(n, -kNever), tube_.to.assign(n, kNever), tube_.dates.assign(n, 0),
        tube_.lost.assign(n, 0);
    const double period = rate_.period_s, drift = std::min(rate_.uncertain, 1.0) * period;
    std::size_t b = 0, on_time = 0;
    for (std::size_t i = 0; i < n; ++i) {
      while (b + 1 < bursts_.size() && x_[i] > bursts_[b].last) ++b;
      if (std::isnan(y_[i])) {
        if (b > 0) tube_.lost[i] = static_cast<std::uint64_t>(lost_[b - 1]);
        continue;
      }
      const ReadEnd& burst = bursts_[b];
      while (on_time + kReads < b && burst.time_s - bursts_[on_time + 1].time_s >= kReadsS) ++on_time;
      tube_.lost[i] = static_cast<std::uint64_t>(lost_[b]);
      tube_.to[i] = std::min(y_[i] + slack(i), levels_[b] + period * x_[i] + drift * (burst.last - x_[i]));
      double& from = tube_.from[i];
      from = y_[i] - width_s_;
      if (b > 0)
        from = std::max(from, bursts_[b - 1].time_s - 2 * most_waited_s_ - slack(i) +
                                  (period - drift) * (x_[i] - burst.first));
      else if (burst.last == burst.first)
        from = std::max(from, tube_.to[i] - jitter_s_);
      if (b >= kReads && burst.time_s - bursts_[on_time].time_s >= kReadsS)
        from = std::max(
            from, levels_[on_time] + period * x_[i] - jitter_s_ - drift * (x_[i] - bursts_[on_time].last));
    }
    for (std::size_t i = 1; i < n; ++i)
      tube_.from[i] = std::max(tube_.from[i], tube_.from[i - 1] + (period - drift) * (x_[i] - x_[i - 1]));
    for (std::size_t i = n; i-- > 0;) {
      if (i + 1 < n)
        tube_.to[i] = std::min(tube_.to[i], tube_.to[i + 1] - (period - drift) * (x_[i + 1] - x_[i]));
      tube_.from[i] = std::min(tube_.from[i], tube_.to[i]);
      const double due = i + 1 < n ? tube_.dates[i + 1] - period * (x_[i + 1] - x_[i]) : tube_.to[i];
      tube_.dates[i] = std::clamp(due, tube_.from[i], tube_.to[i]);
    }
  }

  std::span<const double> x_, y_, slack_;
  double width_s_, nominal_s_, tolerance_;
  Rate rate_{0, 0};
  std::vector<ReadEnd> bursts_;
  std::vector<double> levels_, lost_;
  double jitter_s_ = 0, most_waited_s_ = 0;
  Tube tube_;
};

// By how much each stamp follows the one before too early: it may have been damaged.
std::vector<double> too_short(std::span<const double> x, std::span<const double> stamp_s, double unit_s) {
  std::vector<double> steps, off(x.size(), 0);
  for (const bool known : {false, true}) {
    const double period = known && !steps.empty() ? median(steps) : 0;
    for (std::size_t i = 1, before = 0; i < x.size(); ++i) {
      if (std::isnan(stamp_s[i])) continue;
      const double step = stamp_s[i] - stamp_s[before], count = x[i] - x[std::exchange(before, i)];
      if (!known && step > 0) steps.push_back(step / count);
      if (period > 4 * unit_s) off[i] = std::max(0.0, period * count - step - unit_s);
    }
  }
  return off;
}

}  // namespace

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

double DeviceStamps::step_to(double raw_s, double from_s, double most_s) const {
  const double step = raw_s - from_s, range = settings_.stamp_range_s;
  if (range <= 0) return step;
  if (elapsed_s_ > 0.5 * range) return step + range * std::round((elapsed_s_ - step) / range);
  return step < 0 && step + range <= most_s ? step + range : step;
}

DeviceStamps::Reading DeviceStamps::read(double stamp_s, double elapsed_s, double period_s) {
  if (!settings_.stored)
    elapsed_s_ += elapsed_s, now_s_ += elapsed_s, least_lag_s_ += kClockDrifts * elapsed_s;
  ++since_;
  if (!(std::abs(stamp_s) < kMostStampS)) return {};
  if (believed_ == 0) return accept(stamp_s, stamp_s, {});
  const double least = settings_.stamp_unit_s > 0.25 * period_s ? 0 : 1e-9;
  // As late as the frames are, so far may a stamp be ahead.
  const double lag_s = now_s_ - last_.time_s - least_lag_s_;
  const double most = std::max({settings_.stored ? kStoredJumpS : lag_s + kOldestS, 10 * period_s});
  const auto goes_on = [&](double step) { return step >= least && step <= most; };
  const double step = step_to(stamp_s, last_.raw_s, most);
  if (goes_on(step)) return accept(stamp_s, last_.time_s + step, {});
  // Where the one before had jumped ahead, and not this one back, it goes on from the one before that.
  const double from_before = step_to(stamp_s, before_.raw_s, most), last_step = last_.time_s - before_.time_s;
  if (believed_ > 1 && !jumped_s_ && goes_on(from_before) &&
      std::abs(from_before - 2 * step_s_) < std::abs(last_step - step_s_))
    return accept(stamp_s, before_.time_s + from_before, {.one_before_damaged = true});
  const double from_jump = jumped_s_ ? step_to(stamp_s, *jumped_s_, most) : -1;
  const bool as_far =
      settings_.stored && from_jump > 0 && std::abs(from_jump - jump_step_s_) < 0.5 * jump_step_s_;
  if (!goes_on(from_jump) && !as_far) {
    jumped_s_ = stamp_s, jump_step_s_ = from_jump;
    return {};
  }
  // Two stamps in a row: the device had paused, or it started anew.
  const bool paused = settings_.stored ? stamp_s > last_.raw_s : step > 0 && step <= most;
  const double since = paused ? step : std::max({elapsed_s_, period_s * since_, from_jump + 1e-3 * period_s});
  last_ = {*jumped_s_, last_.time_s + since - from_jump};
  return accept(stamp_s, last_.time_s + from_jump,
                {.one_before_s = last_.time_s, .reset = !paused && believed_ > 1, .anew = !paused});
}

DeviceStamps::Reading DeviceStamps::accept(double raw_s, double time_s, Reading reading) {
  if (!reading.one_before_damaged) step_s_ = last_.time_s - before_.time_s, before_ = last_;
  last_ = {raw_s, time_s};
  least_lag_s_ = believed_ == 0 || reading.anew ? now_s_ - time_s : std::min(least_lag_s_, now_s_ - time_s);
  jumped_s_.reset();
  jump_step_s_ = elapsed_s_ = since_ = 0;
  ++believed_;
  reading.time_s = time_s;
  return reading;
}

FrameClock::FrameClock(const ClockSettings& settings)
    : settings_(settings),
      rate_{settings.period_s, settings.tolerance},
      stamps_(settings),
      most_waited_s_(settings.stamp_unit_s > 0 ? 0 : kOldestS) {}

void FrameClock::keep_low(const ReadEnd& burst) {
  while (!lows_.empty() && (lows_.back().burst == closed_ || lows_.back().level_s >= level(burst)))
    lows_.pop_back();
  lows_.push_back({closed_, level(burst)});
}

// By so much (s) the earliest of the last reads may have been late.
double FrameClock::jitter_s() const {
  return late_count_ < kReads ? (settings_.stamp_unit_s > 0 ? settings_.stamp_unit_s : kOldestS)
                              : kLate * late_sum_s_ / late_count_;
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
  while (window_.size() > kReads + 1 && time_s - window_[1].time_s >= kReadsS) drop_front();
  count_lost();
}

void FrameClock::drop_front() {
  const ReadEnd burst = window_.front();
  const double low_s =
      lows_.front().level_s - rate_.uncertain * rate_.period_s * (window_.back().last - burst.last);
  late_sum_s_ += level(burst) - low_s, ++late_count_;
  const double waited_s = burst.time_s - rate_.period_s * burst.first - low_s - burst.gap_s;
  if (late_count_ == kEnough) most_waited_s_ = 0;
  if (late_count_ >= kEnough) most_waited_s_ = std::max({most_waited_s_, waited_s, jitter_s()});
  window_.pop_front();
  if (lows_.front().burst == closed_ - window_.size()) lows_.pop_front();
  ends_.push_back(burst);
  ++ended_;
  const bool due = ended_ % 64 == 0 || (ended_ < 64 && ended_ >= kReads && std::has_single_bit(ended_));
  if (due) learn();
}

// The envelope stays late by whole periods: frames were lost; unless it comes back.
void FrameClock::count_lost() {
  const double low_s = lows_.front().level_s, rise = low_s - level_s_, period = rate_.period_s;
  const double reads = static_cast<double>(std::min(window_.size(), kReads));
  const double drift = rate_.uncertain * period * (window_.back().last - window_.front().last);
  if (levelled_ && reads >= kFew && rise > kWholePeriod * period + drift &&
      reads * rise > kReads * jitter_s())
    lost_ += static_cast<std::uint64_t>(std::lround(rise / period));
  if (levelled_ && rise < -kWholePeriod * period)
    lost_ -= std::min(lost_, static_cast<std::uint64_t>(std::lround(-rise / period)));
  level_s_ = low_s, levelled_ = true;
}

void FrameClock::learn() {
  if (ends_.size() > kMostEnds) ends_.erase(ends_.begin(), ends_.end() - kMostEnds / 2);
  const Rate found = slope_of(ends_, rate_.period_s, 0.125);
  const double off = found.period_s / settings_.period_s,
               differs = std::abs(found.period_s / rate_.period_s - 1);
  if (found.uncertain >= kNever || off > 1 + settings_.tolerance || off < 1 / (1 + settings_.tolerance))
    return;
  rate_.uncertain = std::min(settings_.tolerance, found.uncertain);
  if (differs <= found.uncertain && found.uncertain > 10 * kSteady) return;
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
  // What came before this read, that one at least of it was on time.
  const double drift = rate_.uncertain * rate_.period_s, front = first_ ? 0 : window_.front().last;
  const double low_s = first_ ? -kNever : lows_.front().level_s - jitter_s();
  take(first, last, time_s);
  const double least = shortest(rate_);
  for (const FrameArrival& frame : frames) {
    const double step = 1 + frame.damaged, to_s = time_s - least * (last - (number_ + step));
    number_ += step;
    double from_s = low_s + rate_.period_s * number_ - drift * (number_ - front);
    if (window_.size() > 1)
      from_s = std::max(from_s, window_[window_.size() - 2].time_s - 2 * most_waited_s_ +
                                    least * (number_ - window_.back().first));
    from_s = std::max(from_s, first_ ? time_s - kOldestS : last_.from_s + least * step);
    dates.push_back(dated(first_ ? to_s : last_.time_s + rate_.period_s * step, from_s, to_s));
  }
}

FrameDate FrameClock::by_stamp(const FrameArrival& frame) {
  const double step = 1 + frame.damaged, period = rate_.period_s, unit = settings_.stamp_unit_s;
  const double elapsed_s = first_ ? 0 : frame.time_s - arrived_s_;
  damaged_ += frame.damaged, number_ += step, unbelieved_s_ += settings_.stored ? 0 : elapsed_s;
  const DeviceStamps::Reading reading =
      frame.stamp_s ? stamps_.read(*frame.stamp_s, elapsed_s, period) : DeviceStamps::Reading{};
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
  return dated(std::clamp(due, stamp_s, stamp_s + (coarse ? unit : 0)), stamp_s - std::max(0.0, off) - unsure,
               stamp_s + unit + std::max(0.0, -off) + unsure);
}

FrameTimeline timeline_of(const ClockSettings& settings, std::span<const FrameArrival> arrivals) {
  FrameTimeline timeline;
  timeline.period_s = timeline.measured_s = settings.period_s;
  const std::size_t n = arrivals.size();
  const double unit = settings.stamp_unit_s, nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> x(n), arrived(n), stamped(n, nan);
  std::vector<std::size_t> begins = {0};  // of what the device ran through
  DeviceStamps stamps(settings);
  std::uint64_t damaged = 0;
  for (std::size_t i = 0; i < n; ++i) {
    damaged += i > 0 ? arrivals[i].damaged : 0;
    x[i] = static_cast<double>(i + damaged), arrived[i] = arrivals[i].time_s;
    if (unit <= 0 || !arrivals[i].stamp_s) continue;
    const double elapsed_s = i > 0 ? arrived[i] - arrived[i - 1] : 0;
    const DeviceStamps::Reading reading = stamps.read(*arrivals[i].stamp_s, elapsed_s, settings.period_s);
    if (reading.one_before_damaged) stamped[i - 1] = nan;
    if (reading.one_before_s) stamped[i - 1] = *reading.one_before_s + unit;
    if (reading.anew && reading.reset) begins.push_back(i - 1), ++timeline.resets;
    if (reading.anew && !reading.reset) std::fill(stamped.begin(), stamped.begin() + i - 1, nan);
    if (reading.time_s) stamped[i] = *reading.time_s + unit;
  }
  begins.push_back(n);
  for (std::size_t part = 0; part + 1 < begins.size(); ++part) {
    const std::size_t from = begins[part], count = begins[part + 1] - from;
    const auto of = [&](const std::vector<double>& all) { return std::span(all).subspan(from, count); };
    if (count == 0) continue;
    const std::uint64_t before = timeline.missing;
    Tube tube;
    if (settings.stored && unit <= 0) {
      for (const double number : of(x)) tube.dates.push_back(settings.period_s * number);
      tube.from = tube.to = tube.dates, tube.lost.assign(count, 0);
      tube.rate = {settings.period_s, 0}, tube.measured_s = settings.period_s;
    } else {
      const std::vector<double> short_by =
          unit > 0 ? too_short(of(x), of(stamped), unit) : std::vector<double>();
      tube = TubeMaker(of(x), of(unit > 0 ? stamped : arrived), unit > 0 ? unit : kNever, settings.period_s,
                       settings.tolerance, short_by)
                 .make();
    }
    timeline.period_s = tube.rate.period_s, timeline.measured_s = tube.measured_s,
    timeline.plausible = tube.plausible;
    for (std::size_t i = 0, before_i = 0; i < count && unit > 0; ++i) {
      if (std::isnan(stamped[from + i])) continue;
      // A stamp that does not come when it is due may be wrong by that; one finer than the frames is the
      // date.
      const double period = tube.rate.period_s, due = period * (x[from + i] - x[from + before_i]);
      const double off = stamped[from + i] - stamped[from + before_i] - due;
      const double unsure = std::min(tube.rate.uncertain, 1.0) * due;
      if (unit <= 0.25 * period) tube.dates[i] = stamped[from + i] - unit;
      tube.from[i] = std::min(tube.from[i], tube.dates[i] - std::max(0.0, off) - unsure);
      tube.to[i] = std::max(tube.to[i], tube.dates[i] + unit + std::max(0.0, -off) + unsure);
      before_i = i;
    }
    if (unit > 0 && !settings.stored) {
      // From the device's clock to the port's: the same model, whose period is now a second of the device.
      std::vector<double> slack(count);
      for (std::size_t i = 0; i < count; ++i)
        slack[i] = std::max(tube.dates[i] - tube.from[i], tube.to[i] - tube.dates[i]);
      const Tube port = TubeMaker(tube.dates, of(arrived), kNever, 1, kClockOff, slack).make();
      for (std::size_t i = 0; i < count; ++i) {
        const double before_s = tube.dates[i] - tube.from[i], after_s = tube.to[i] - tube.dates[i];
        tube.from[i] = port.from[i] - before_s - unit, tube.to[i] = port.to[i] + after_s,
        tube.dates[i] = port.dates[i];
      }
      timeline.period_s *= port.rate.period_s, timeline.measured_s *= port.rate.period_s;
    }
    for (std::size_t i = 0; i < count; ++i) {
      FrameDate date{tube.dates[i], tube.from[i], tube.to[i],
                     before + tube.lost[i] + static_cast<std::uint64_t>(x[from + i]) - (from + i)};
      if (!timeline.dates.empty() && date.time_s <= timeline.dates.back().time_s) {
        date.time_s = timeline.dates.back().time_s + 1e-3 * timeline.period_s;
        date.to_s = std::max(date.to_s, date.time_s);
      }
      timeline.dates.push_back(date);
    }
    timeline.missing += tube.lost.back();
  }
  timeline.missing += damaged;
  return timeline;
}

}  // namespace supertac
