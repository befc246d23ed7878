#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include "data/clock/clock_model.h"
#include "io/numbers/median.h"

namespace supertac {

using namespace clock_model;

namespace {

/// A whole recording's envelope: for every frame the interval of its time, and what was lost before it.
struct Tube {
  std::vector<double> from, to, dates;
  std::vector<std::uint64_t> lost;
  Rate rate;
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
    rate_ = stated();
    gather(false);
    // First with what was lost in it, then without.
    for (const double farthest : {0.125, 0.5, 0.5}) {
      find_rate(farthest);
      gather(true);
      find_levels();
    }
    tube_.rate = rate_;
    find_intervals();
    return std::move(tube_);
  }

 private:
  Rate stated() const { return {nominal_s_, tolerance_, std::min(tolerance_, 1.0)}; }
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
    if (width_s_ >= kNever)
      found = doubted(found, {.period_s = nominal_s_, .tolerance = tolerance_}, jitter_s_);
    const double off = found.period_s / nominal_s_;
    tube_.plausible = off <= 1 + tolerance_ && off >= 1 / (1 + tolerance_);
    tube_.measured_s = found.period_s;
    if (found.uncertain >= kNever || !tube_.plausible) found = stated();
    const double most = 2 * tolerance_;
    rate_ = {found.period_s, std::min(found.uncertain, most), std::min(found.wanders, most)};
  }

  double slack(std::size_t i) const { return slack_.empty() ? 0 : slack_[i]; }
  double level(const ReadEnd& burst) const {
    return burst.time_s + burst.slack_s - rate_.period_s * burst.last;
  }

  // The highest line with this rate under all arrivals that follow, and its steps.
  void find_levels() {
    levels_.assign(bursts_.size(), 0);
    lost_.assign(bursts_.size(), 0);
    const double drift = rate_.uncertain * rate_.period_s;
    const std::size_t count = bursts_.size();
    // How late a read is against the earliest of its window, the rate being as unlucky as may be.
    std::deque<std::size_t> lows;
    std::vector<double> late;
    const double span = span_s(jitter_s_);
    const auto falling = [&](std::size_t b) {
      return level(bursts_[b]) - rate_.wanders * rate_.period_s * bursts_[b].last;
    };
    std::size_t ahead = count;
    for (std::size_t b = count; b-- > 0;) {
      levels_[b] = level(bursts_[b]);
      if (b + 1 < count)
        levels_[b] = std::min(levels_[b], levels_[b + 1] + drift * (bursts_[b + 1].last - bursts_[b].last));
      while (!lows.empty() && falling(lows.back()) >= falling(b)) lows.pop_back();
      lows.push_back(b);
      while (ahead > b + 1 + kReads && bursts_[ahead - 2].time_s - bursts_[b].time_s >= span) --ahead;
      while (lows.front() >= ahead) lows.pop_front();
      if (ahead - b <= kReads || bursts_[ahead - 1].time_s - bursts_[b].time_s < span) continue;
      late.push_back(falling(b) - falling(lows.front()));
    }
    const double late_s = late.empty() ? 0 : bursts_[late.size() - 1].time_s - bursts_[0].time_s;
    jitter_s_ =
        late.size() < kReads || late_s < kReadsS ? std::min(kOldestS, width_s_) : quantile(late, kLateShare);
    most_waited_s_ = jitter_s_;
    for (std::size_t b = 1; b < count; ++b) {
      const double rise = levels_[b] - levels_[b - 1];
      const bool sure = rate_.uncertain < kKnown &&
                        rise > kWholePeriod * rate_.period_s + grain(width_s_, rate_.period_s) &&
                        for_good(count - b, bursts_.back().time_s - bursts_[b].time_s, rise, jitter_s_);
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
    struct Window {
      std::size_t reads;
      double seconds;
      std::size_t begin = 0;
    };
    // Of few reads in a row one at least was not very late, of many one was hardly late.
    std::vector<double> slacks(slack_.begin(), slack_.end());
    const double usual_slack = slacks.empty() ? 0 : median(slacks);
    std::array<Window, 2> windows = {Window{kFew, kFew * jitter_s_}, Window{kReads, span_s(jitter_s_)}};
    std::size_t b = 0, emptied = 0;  // the read of frame i; the one in front of it that took all
    for (std::size_t i = 0; i < n; ++i) {
      for (; b + 1 < bursts_.size() && x_[i] > bursts_[b].last; ++b)
        if (b == 0 || bursts_[b].last == bursts_[b].first || (lost_[b] - lost_[b - 1]) * period <= jitter_s_)
          emptied = b;
      if (std::isnan(y_[i])) {
        if (b > 0) tube_.lost[i] = static_cast<std::uint64_t>(lost_[b - 1]);
        continue;
      }
      const ReadEnd& burst = bursts_[b];
      tube_.lost[i] = static_cast<std::uint64_t>(lost_[b]);
      tube_.to[i] = std::min(y_[i] + slack(i), levels_[b] + period * x_[i] + drift * (burst.last - x_[i]));
      double& from = tube_.from[i];
      from = y_[i] - width_s_;
      if (b > 0)
        from = std::max(from, bursts_[emptied].time_s - 2 * most_waited_s_ - slack(i) +
                                  (period - drift) * (x_[i] - burst.first));
      else if (burst.last == burst.first)  // it was waited for
        from = std::max(from, tube_.to[i] - kDecades * jitter_s_);
      for (Window& w : windows) {
        while (w.begin + w.reads < b && burst.time_s - bursts_[w.begin + 1].time_s >= w.seconds) ++w.begin;
        if (b - w.begin < w.reads || burst.time_s - bursts_[w.begin].time_s < w.seconds) continue;
        const double late_s = jitter_s_ * kDecades / static_cast<double>(w.reads) + 2 * usual_slack;
        from = std::max(from,
                        levels_[w.begin] + period * x_[i] - late_s - drift * (x_[i] - bursts_[w.begin].last));
      }
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
  Rate rate_;
  std::vector<ReadEnd> bursts_;
  std::vector<double> levels_, lost_;
  double jitter_s_ = 0, most_waited_s_ = 0;
  Tube tube_;
};

// By how much each stamp follows the one before too early: it may have been damaged.
std::vector<double> too_short(std::span<const double> x, std::span<const double> stamp_s, double unit_s) {
  std::vector<double> steps, off(x.size(), 0);
  double went_s = 0, frames = 0;
  for (const bool known : {false, true}) {
    const double period = known && !steps.empty() ? std::min(median(steps), went_s / frames) : 0;
    for (std::size_t i = 1, before = 0; i < x.size(); ++i) {
      if (std::isnan(stamp_s[i])) continue;
      const double step = stamp_s[i] - stamp_s[before], count = x[i] - x[std::exchange(before, i)];
      if (!known && step > 0) steps.push_back(step / count);
      if (!known && step > 0) went_s += step, frames += count;
      off[i] = std::max(0.0, period * count - step - unit_s);
    }
  }
  return off;
}

// The intervals of stamps. One that is whole periods from a neighbour is right up to what is left over and a
// unit; one that is so from none may be wrong by all that lies between them. One that is finer than the
// frames is the date.
void bound_by_stamps(std::span<const double> x, std::span<const double> stamp_s, double unit_s, Tube& tube) {
  const double period = tube.rate.period_s, unsure = std::min(tube.rate.uncertain, 1.0) * period;
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!std::isnan(stamp_s[i])) at.push_back(i);
  std::vector<double> late, rest, sorted;  // of each step from one to the next, and without whole periods
  for (std::size_t k = 0; k + 1 < at.size(); ++k) {
    late.push_back(stamp_s[at[k + 1]] - stamp_s[at[k]] - period * (x[at[k + 1]] - x[at[k]]));
    rest.push_back(late[k] - period * std::max(0.0, std::round(late[k] / period)));
    sorted.push_back(std::abs(rest[k]));
  }
  const double usual = rest.empty() ? 0 : 2 * (quantile(sorted, kLateShare) + unit_s);
  for (std::size_t k = 0; k < at.size(); ++k) {
    const std::size_t i = at[k];
    const double frames = k > 0 ? x[i] - x[at[k - 1]] : 1;
    const auto fits = [&](std::size_t step) {
      return step < late.size() && std::abs(rest[step]) <= usual + unsure * frames;
    };
    const bool right = (k > 0 && fits(k - 1)) || fits(k);
    const double before = k == 0                 ? 0
                          : right && fits(k - 1) ? rest[k - 1]
                          : right                ? std::min(late[k - 1], 0.0)
                                                 : late[k - 1];
    const double after = k >= late.size()   ? 0
                         : right && fits(k) ? rest[k]
                         : right            ? std::min(late[k], 0.0)
                                            : late[k];
    const double too_late = std::max({0.0, before, -after}), too_early = std::max({0.0, -before, after});
    if (unit_s <= 0.25 * period) tube.dates[i] = stamp_s[i] - unit_s;
    tube.from[i] = std::min(tube.from[i], tube.dates[i] - too_late - unsure * frames);
    tube.to[i] = std::max(tube.to[i], tube.dates[i] + unit_s + too_early + unsure * frames);
  }
}

}  // namespace

FrameTimeline timeline_of(const ClockSettings& settings, std::span<const FrameArrival> arrivals) {
  FrameTimeline timeline;
  timeline.period_s = timeline.measured_s = settings.period_s;
  const std::size_t n = arrivals.size();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  double unit = settings.stamp_unit_s;
  for (const FrameArrival& arrival : arrivals)
    if (unit > 0 && arrival.stamp_s) unit = finer_unit(*arrival.stamp_s, unit);
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
      tube.rate.period_s = settings.period_s, tube.measured_s = settings.period_s;
    } else {
      const std::vector<double> short_by =
          unit > 0 ? too_short(of(x), of(stamped), unit) : std::vector<double>();
      tube = TubeMaker(of(x), of(unit > 0 ? stamped : arrived), unit > 0 ? unit : kNever, settings.period_s,
                       settings.tolerance, short_by)
                 .make();
    }
    timeline.period_s = tube.rate.period_s, timeline.measured_s = tube.measured_s,
    timeline.plausible = tube.plausible;
    if (unit > 0) bound_by_stamps(of(x), of(stamped), unit, tube);
    if (unit > 0 && !settings.stored) {
      // From the device's clock to the port's: the same model, whose period is now a second of the device.
      std::vector<double> slack(count);
      for (std::size_t i = 0; i < count; ++i)
        slack[i] = (1 + kClockDrifts) * std::max(tube.dates[i] - tube.from[i], tube.to[i] - tube.dates[i]);
      const Tube port = TubeMaker(tube.dates, of(arrived), kNever, 1, kClockOff, slack).make();
      for (std::size_t i = 0; i < count; ++i) {
        const double before_s = tube.dates[i] - tube.from[i], after_s = tube.to[i] - tube.dates[i];
        tube.from[i] = port.from[i] - (1 + kClockDrifts) * before_s - unit,
        tube.to[i] = port.to[i] + (1 + kClockDrifts) * after_s, tube.dates[i] = port.dates[i];
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
