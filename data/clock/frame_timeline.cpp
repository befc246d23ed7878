#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <utility>

#include "data/clock/frame_clock.h"
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
      : x_(x), y_(y), slack_(slack), width_s_(width_s), nominal_s_(period_s), tolerance_(tolerance) {
    std::vector<double> slacks(slack.begin(), slack.end());
    if (!slacks.empty()) usual_slack_s_ = median(slacks);
  }

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
  Rate stated() const { return {nominal_s_, tolerance_}; }
  void gather(bool merged) {
    bursts_.clear();
    for (std::size_t i = 0; i < x_.size(); ++i)
      if (!std::isnan(y_[i]))
        add_read(bursts_, {.first = x_[i], .last = x_[i], .time_s = y_[i], .slack_s = slack(i)},
                 merged ? shortest(rate_) : 0);
  }

  void find_rate(double farthest) {
    std::vector<ReadEnd> ends = bursts_;
    for (std::size_t b = 0; b < ends.size() && b < lost_.size(); ++b)
      ends[b].time_s -= rate_.period_s * lost_[b];
    const double off_s = std::max(unit_s_, 2 * usual_slack_s_);
    Rate found = slope_of(ends, rate_.period_s, farthest, off_s);
    found = slope_of(ends, found.period_s, farthest, off_s);
    if (left_s_ > 0)
      found.uncertain = std::max(found.uncertain, 4 * left_s_ / (ends.back().time_s - ends.front().time_s));
    const double off = found.period_s / nominal_s_;
    tube_.plausible = off <= 1 + tolerance_ && off >= 1 / (1 + tolerance_);
    tube_.measured_s = found.period_s;
    if (found.uncertain >= kNever || !tube_.plausible) found = stated();
    rate_ = told_ = {found.period_s, std::min(found.uncertain, 2 * tolerance_)};
    if (width_s_ >= kNever) rate_ = doubted(rate_, nominal_s_, tolerance_, late_.jitter_s);
  }

  double slack(std::size_t i) const { return slack_.empty() ? 0 : slack_[i]; }

  // The highest line with this rate under all arrivals that follow, and its steps.
  void find_levels() {
    levels_.assign(bursts_.size(), 0);
    lost_.assign(bursts_.size(), 0);
    const double drift = rate_.uncertain * rate_.period_s;
    const std::size_t count = bursts_.size();
    for (std::size_t b = count; b-- > 0;) {
      levels_[b] = bursts_[b].level_s(rate_.period_s);
      if (b + 1 < count)
        levels_[b] = std::min(levels_[b], levels_[b + 1] + drift * (bursts_[b + 1].last - bursts_[b].last));
    }
    late_ = lateness_of(bursts_, told_, span_s(late_.jitter_s, unit_s_));
    if (!late_.known) late_.jitter_s = late_.waited_s = std::min(kOldestS, width_s_);
    left_s_ = 0;
    for (std::size_t b = 1; b < count; ++b) {
      const double rise = levels_[b] - levels_[b - 1];
      const bool sure = rate_.uncertain < kKnown &&
                        rise > 0.5 * rate_.period_s + grain(width_s_, rate_.period_s) &&
                        for_good(count - b, bursts_.back().time_s - bursts_[b].time_s, rise, late_.jitter_s);
      lost_[b] = lost_[b - 1] + (sure ? std::round(rise / rate_.period_s) : 0);
      if (sure) left_s_ = std::max(left_s_, std::abs(std::remainder(rise, rate_.period_s)));
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
    std::array<Window, 2> windows = {Window{kWitnesses, kWitnesses * late_.jitter_s},
                                     Window{kReads, span_s(late_.jitter_s, unit_s_)}};
    std::size_t b = 0, emptied = 0;  // the read of frame i; the one in front of it that took all
    for (std::size_t i = 0; i < n; ++i) {
      for (; b + 1 < bursts_.size() && x_[i] > bursts_[b].last; ++b)
        if (b == 0 || bursts_[b].last == bursts_[b].first ||
            (lost_[b] - lost_[b - 1]) * period <= late_.jitter_s)
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
        from = std::max(from, bursts_[emptied].time_s - late_.waited_s - slack(i) +
                                  (period - drift) * (x_[i] - burst.first));
      else if (burst.last == burst.first)  // it was waited for
        from = std::max(from, tube_.to[i] - kDecades * late_.jitter_s - 2 * slack(i));
      for (Window& w : windows) {
        while (w.begin + w.reads < b && burst.time_s - bursts_[w.begin + 1].time_s >= w.seconds) ++w.begin;
        if (b - w.begin < w.reads || burst.time_s - bursts_[w.begin].time_s < w.seconds) continue;
        const double late_s =
            late_.unsure * late_.jitter_s * kDecades / static_cast<double>(w.reads) + 2 * usual_slack_s_;
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
      const bool told = i + 1 < n && tube_.to[i + 1] < 0.5 * kNever;
      const double due = told ? tube_.dates[i + 1] - period * (x_[i + 1] - x_[i]) : tube_.to[i];
      tube_.dates[i] = std::clamp(due, tube_.from[i], tube_.to[i]);
    }
    for (std::size_t i = 1; i < n; ++i)
      if (tube_.to[i] >= 0.5 * kNever)
        tube_.dates[i] = std::max(tube_.from[i], tube_.dates[i - 1] + period * (x_[i] - x_[i - 1]));
  }

  std::span<const double> x_, y_, slack_;
  double width_s_, nominal_s_, tolerance_, unit_s_ = width_s_ < kNever ? width_s_ : 0, usual_slack_s_ = 0;
  Rate rate_, told_;  // as it may be; as reads tell it, with what is lost all the time in it
  std::vector<ReadEnd> bursts_;
  std::vector<double> levels_, lost_;
  double left_s_ = 0;  // a device that started anew was silent for so much more than whole periods
  Lateness late_;
  Tube tube_;
};

// A device's stamps, NaN where one is not believed, and what those next to each say of it: frames are
// `period_s` apart at least.
class StampedFrames {
 public:
  StampedFrames(std::span<const double> x, std::span<const double> stamp_s, double unit_s)
      : x_(x), stamp_s_(stamp_s), unit_s_(unit_s) {
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!std::isnan(stamp_s[i])) at_.push_back(i);
  }

  // As arrivals, none of which is too early or late for its neighbours.
  std::vector<double> arrivals() const {
    std::vector<double> steps, out(stamp_s_.begin(), stamp_s_.end());
    double went_s = 0, frames = 0;
    for (std::size_t k = 1; k < at_.size(); ++k) {
      const double step = stamp_s_[at_[k]] - stamp_s_[at_[k - 1]], count = x_[at_[k]] - x_[at_[k - 1]];
      if (step > 0) steps.push_back(step / count), went_s += step, frames += count;
    }
    const double period = steps.empty() ? 0 : std::min(median(steps), went_s / frames);
    for (std::size_t k = 0; k < at_.size(); ++k) {
      std::vector<double> levels;
      const bool inner = k >= kWitnesses - 1 && k + kWitnesses <= at_.size();
      for (std::size_t m = k + 1 - kWitnesses; inner && m < k + kWitnesses; ++m)
        levels.push_back(stamp_s_[at_[m]] - period * x_[at_[m]]);
      out[at_[k]] = inner ? median(levels) + period * x_[at_[k]] : NAN;
    }
    return out;
  }

  // A stamp is right to its unit, or two on one side of it are not both wrong.
  void bound(Tube& tube) const {
    const double period = tube.rate.period_s, least = shortest(tube.rate), unsure = 2 * (period - least);
    for (std::size_t i = 0, k = 0; i < x_.size(); ++i) {
      const bool stamped = k < at_.size() && at_[k] == i;
      const std::size_t behind = k + (stamped ? 0 : -1);
      double &from = tube.from[i], &to = tube.to[i], &date = tube.dates[i];
      from = std::min(earliest(k, 1, i, least), earliest(k, 2, i, least));
      to = std::max(latest(behind, 1, i, least), latest(behind, 2, i, least));
      if (stamped) {
        const double stamp_s = stamp_s_[i], begin_s = stamp_s - unit_s_;
        from = std::min(from, begin_s - unsure), to = std::max(to, stamp_s + unsure);
        date = unit_s_ <= 0.25 * period ? begin_s : std::clamp(date, begin_s, stamp_s);
      }
      date = std::clamp(date, from, to);
      k += stamped;
    }
  }

 private:
  // The earliest that frame i was finished after the `apart`th stamp before the kth, the latest before that
  // behind.
  double earliest(std::size_t k, std::size_t apart, std::size_t i, double period_s) const {
    if (k < apart) return -kNever;
    return stamp_s_[at_[k - apart]] - unit_s_ + period_s * (x_[i] - x_[at_[k - apart]]);
  }
  double latest(std::size_t k, std::size_t apart, std::size_t i, double period_s) const {
    if (k + apart >= at_.size()) return kNever;
    return stamp_s_[at_[k + apart]] - period_s * (x_[at_[k + apart]] - x_[i]);
  }
  std::span<const double> x_, stamp_s_;
  double unit_s_;
  std::vector<std::size_t> at_;
};

// The stamps that are believed, NaN for others, and the first frame of each time that the device ran.
struct ReadStamps {
  std::vector<double> time_s;
  std::vector<std::size_t> begins = {0};
};

ReadStamps read_stamps(const ClockSettings& settings, std::span<const FrameArrival> arrivals, double unit_s) {
  ReadStamps out;
  out.time_s.assign(arrivals.size(), NAN);
  DeviceStamps stamps(settings);
  std::vector<std::size_t> at;
  double ahead_s = 0;  // as wrong as the first stamps were
  std::vector<double> steps;
  for (std::size_t i = 1; i < arrivals.size(); ++i)
    if (arrivals[i].stamp_s && arrivals[i - 1].stamp_s)
      steps.push_back((*arrivals[i].stamp_s - *arrivals[i - 1].stamp_s) / (1 + arrivals[i].damaged));
  const Rate rate{steps.empty() ? settings.period_s : median(steps), 0.5};
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    if (unit_s <= 0 || !arrivals[i].stamp_s) continue;
    const double elapsed_s = at.empty() ? 0 : arrivals[i].time_s - arrivals[at.back()].time_s;
    const DeviceStamps::Reading reading = stamps.read(*arrivals[i].stamp_s, elapsed_s, rate);
    at.push_back(i);
    std::size_t begin = i;
    for (const DeviceStamps::Revision& one : reading.revised) {
      const std::size_t k = at[at.size() - 1 - one.back];
      out.time_s[k] = one.time_s ? *one.time_s - ahead_s + unit_s : NAN;
      if (one.time_s) begin = k;
    }
    if (reading.reset) out.begins.push_back(begin);
    if (reading.time_s) out.time_s[i] = *reading.time_s - ahead_s + unit_s;
    if (!reading.anew || reading.reset) continue;
    const double more_s = out.time_s[begin] - unit_s - *arrivals[begin].stamp_s;
    ahead_s += more_s;
    for (std::size_t k = 0; k <= i; ++k) out.time_s[k] = k < begin ? NAN : out.time_s[k] - more_s;
  }
  out.begins.push_back(arrivals.size());
  return out;
}

// From the device's clock to the port's: the same model, whose period is now a second of the device. What is
// doubted, and the ends, which no neighbour bears out, are no witness.
Rate to_port(std::span<const double> arrived_s, double unit_s, Tube& tube) {
  const std::size_t count = arrived_s.size();
  std::vector<double> slack(count), witness(arrived_s.begin(), arrived_s.end());
  for (std::size_t i = 0; i < count; ++i)
    slack[i] = (1 + kClockDrifts) * std::max(tube.dates[i] - tube.from[i], tube.to[i] - tube.dates[i]);
  std::vector<double> sorted = slack;
  const double most_s = 2 * median(sorted);
  for (std::size_t i = 0; i < count; ++i)
    if (slack[i] > most_s || (count > kWitnesses && (i == 0 || i + 1 == count))) witness[i] = NAN;
  const Tube port = TubeMaker(tube.dates, witness, kNever, 1, 0.5, slack).make();
  for (std::size_t i = 0; i < count; ++i) {
    const double before_s = tube.dates[i] - tube.from[i], after_s = tube.to[i] - tube.dates[i];
    tube.from[i] = port.from[i] - (1 + kClockDrifts) * before_s - unit_s;
    tube.to[i] = std::min(arrived_s[i], port.to[i] + (1 + kClockDrifts) * after_s);
    tube.dates[i] = std::clamp(port.dates[i], std::min(tube.from[i], tube.to[i]), tube.to[i]);
  }
  return port.rate;
}

}  // namespace

FrameTimeline timeline_of(const ClockSettings& settings, std::span<const FrameArrival> arrivals) {
  FrameTimeline timeline;
  timeline.period_s = timeline.measured_s = settings.period_s;
  const std::size_t n = arrivals.size();
  double unit = settings.stamp_unit_s;
  for (const FrameArrival& arrival : arrivals)
    if (unit > 0 && arrival.stamp_s) unit = finer_unit(*arrival.stamp_s, unit);
  std::vector<double> x(n), arrived(n);
  std::uint64_t damaged = 0;
  for (std::size_t i = 0; i < n; ++i) {
    damaged += i > 0 ? arrivals[i].damaged : 0;
    x[i] = static_cast<double>(i + damaged), arrived[i] = arrivals[i].time_s;
  }
  const ReadStamps stamps = read_stamps(settings, arrivals, unit);
  timeline.resets = stamps.begins.size() - 2;
  for (std::size_t part = 0; part + 1 < stamps.begins.size(); ++part) {
    const std::size_t from = stamps.begins[part], count = stamps.begins[part + 1] - from;
    const auto of = [&](const std::vector<double>& all) { return std::span(all).subspan(from, count); };
    if (count == 0) continue;
    const std::uint64_t before = timeline.missing;
    Tube tube;
    if (settings.stored && unit <= 0) {
      for (const double number : of(x)) tube.dates.push_back(settings.period_s * number);
      tube.from = tube.to = tube.dates, tube.lost.assign(count, 0);
      tube.rate.period_s = tube.measured_s = settings.period_s;
    } else if (unit <= 0) {
      tube = TubeMaker(of(x), of(arrived), kNever, settings.period_s, settings.tolerance).make();
    } else {
      const StampedFrames stamped(of(x), of(stamps.time_s), unit);
      tube = TubeMaker(of(x), stamped.arrivals(), unit, settings.period_s, settings.tolerance).make();
      stamped.bound(tube);
    }
    timeline.period_s = tube.rate.period_s, timeline.measured_s = tube.measured_s,
    timeline.plausible = tube.plausible;
    if (unit > 0 && !settings.stored) {
      const double second_s = to_port(of(arrived), unit, tube).period_s;
      timeline.period_s *= second_s, timeline.measured_s *= second_s;
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
