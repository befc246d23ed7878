#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

#include "data/clock/clock_model.h"
#include "io/numbers/median.h"

namespace supertac::clock_model {

Rate slope_of(std::span<const ReadEnd> ends, double period_s, double farthest, double unit_s) {
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

Lateness lateness_of(std::span<const ReadEnd> ends, const Rate& rate, double span_s) {
  const std::size_t count = rate.uncertain < 10 ? ends.size() : 0;  // else levels say nothing
  const auto level = [&](std::size_t b) {
    return ends[b].time_s + ends[b].slack_s - rate.period_s * ends[b].last;
  };
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

}  // namespace supertac::clock_model
