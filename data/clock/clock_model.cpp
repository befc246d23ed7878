#include <algorithm>
#include <cmath>
#include <deque>

#include "data/clock/frame_clock.h"
#include "io/numbers/median.h"

namespace supertac {

using namespace clock_model;

constexpr double kSteady = 2e-4;  // a period stays so
constexpr double kSure = 18;      // median deviations
constexpr double kDense = 0.15;   // losses of fewer frames may go on all the time

double clock_model::span_s(double jitter_s, double unit_s) {
  return unit_s > 0 ? kReads * unit_s : std::clamp(kReads * jitter_s, 0.25, 2.0);
}

bool clock_model::for_good(std::size_t reads, double seconds, double rise_s, double jitter_s) {
  const double alone =
      std::min({static_cast<double>(reads), 1.0 * kReads, 1 + seconds / std::max(jitter_s, 1e-9)});
  return reads >= kWitnesses && alone * rise_s > kDecades * jitter_s;
}

Rate clock_model::doubted(Rate found, double stated_s, double tolerance, double jitter_s) {
  const double off = found.period_s / stated_s;
  if (tolerance < kKnown || jitter_s < 0.25 * found.period_s) return found;
  const bool stated = off > 1 && off * (1 - kDense) < 1;
  found.uncertain = std::max(found.uncertain, stated ? 1 - (1 - kSteady) / off : kDense);
  return found;
}

Rate clock_model::slope_of(std::span<const ReadEnd> ends, double period_s, double farthest, double unit_s) {
  const std::size_t each = std::clamp<std::size_t>(ends.size() / 16, 1, 8), blocks = ends.size() / each;
  std::vector<ReadEnd> points;
  for (std::size_t b = 0; b < blocks; ++b)
    points.push_back(std::ranges::min(ends.subspan(b * each, each), {}, [period_s](const ReadEnd& end) {
      return end.time_s - period_s * end.last;
    }));
  Rate best{period_s, kNever};
  double surest = kNever, longest = 0, nearer = 0, shortest = kNever;
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
    const double share = median(off) / slope;
    const double over_s = slope * static_cast<double>(apart) * (points.back().last - points.front().last) /
                          static_cast<double>(points.size() - 1);
    const double uncertain =
        std::max({kSteady, kSure * share * (1 + 16 / count) / std::sqrt(count), unit_s / over_s});
    slow = std::max(slow, kSure * share * static_cast<double>(apart) / static_cast<double>(blocks));
    // What was lost makes a slope longer, the more so the farther apart; never shorter.
    longest = std::max(longest, slope * (1 - uncertain)), shortest = std::min(shortest, slope);
    if (slope > 0 && slope * (1 + uncertain) < surest)
      best = {slope, uncertain}, surest = slope * (1 + uncertain), nearer = longest;
  }
  const double apart = std::max(1 - shortest / best.period_s, nearer / best.period_s - 1);
  best.uncertain = std::max({best.uncertain, slow, 1.5 * apart});
  return best;
}

Lateness clock_model::lateness_of(std::span<const ReadEnd> ends, const Rate& rate, double span_s) {
  const std::size_t count = rate.uncertain < 10 ? ends.size() : 0;  // else levels say nothing
  const auto level = [&](std::size_t b) { return ends[b].level_s(rate.period_s); };
  // The rate being as unlucky as may be.
  const double unsure_s = std::min(rate.uncertain, 1.0) * rate.period_s;
  const auto falling = [&](std::size_t b) { return level(b) - unsure_s * ends[b].last; };
  struct Window {
    std::size_t end = 0, lowest = 0;
  };
  std::deque<std::size_t> lows;
  std::vector<Window> windows(count);
  std::vector<double> late;
  std::size_t end = count, pairs = 0;
  double fell_s = 0, ahead = 0;
  std::vector<double> waits;
  for (std::size_t b = count; b-- > 0;) {
    while (!lows.empty() && falling(lows.back()) >= falling(b)) lows.pop_back();
    lows.push_back(b);
    while (end > b + 1 + kReads && ends[end - 2].time_s - ends[b].time_s >= span_s) --end;
    while (lows.front() >= end) lows.pop_front();
    if (b > 0)
      waits.push_back(ends[b].time_s - rate.period_s * ends[b].first - level(lows.front()) - ends[b].gap_s);
    ahead += 0.5 * (ends[lows.front()].last - ends[b].first) / static_cast<double>(count);
    if (end - b <= kReads || ends[end - 1].time_s - ends[b].time_s < span_s) continue;
    late.push_back(falling(b) - falling(lows.front()));
    windows[b] = {end, lows.front()};
    if (end == count || windows[end].end == 0) continue;
    fell_s = std::max(fell_s, level(windows[b].lowest) - level(windows[end].lowest)), ++pairs;
  }
  if (late.size() < kReads) return {};
  const auto decades = [](std::size_t n) { return std::log10(std::max(1.0, static_cast<double>(n))); };
  const double together_s = kReads * fell_s / (3 + decades(pairs / kReads));
  const double jitter_s = std::max(quantile(late, 0.9), together_s);
  // A read that is late by more than a period holds up those behind it: few then say little.
  const double few = jitter_s > rate.period_s ? 2.0 * kReads / static_cast<double>(late.size()) : 0;
  const double most = *std::ranges::max_element(waits), usual = quantile(waits, 0.9);
  const double waited_s = usual + (kDecades - 1) * (most - usual) / (decades(waits.size()) - 1);
  return {jitter_s, std::max(0.0, waited_s + unsure_s * ahead), true, 1 + few};
}

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
