#include "hardware/boards/frame_clock.h"
#include "io/numbers/median.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace supertac {
namespace {

constexpr std::size_t kMostPoints = 2048;
constexpr double kEarly = 0.3;  // periods of jitter that still count as on time
constexpr int kTrackBlock = 32;

struct Line {
  double slope, intercept;
};

template <class Points>
Line least_squares(const Points& points, const std::vector<bool>& used) {
  double n = 0, x0 = 0, y0 = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!used[i]) continue;
    n += 1;
    x0 += points[i].index;
    y0 += points[i].arrival;
  }
  x0 /= n;
  y0 /= n;
  double xx = 0, xy = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!used[i]) continue;
    xx += (points[i].index - x0) * (points[i].index - x0);
    xy += (points[i].index - x0) * (points[i].arrival - y0);
  }
  const double slope = xy / xx;
  return {slope, y0 - slope * x0};
}

}  // namespace

void ClockEstimator::add(std::uint64_t index, double arrival_s) {
  const Point point{static_cast<double>(index), arrival_s};
  const auto lateness = [](const Point& p) { return p.arrival - rig::kFramePeriodS * p.index; };
  if (in_block_ == 0 || lateness(point) < lateness(earliest_)) earliest_ = point;
  if (++in_block_ >= block_) close_block();
}

void ClockEstimator::close_block() {
  points_.push_back(earliest_);
  in_block_ = 0;
  if (points_.size() < kMostPoints) return;
  const auto lateness = [](const Point& p) { return p.arrival - rig::kFramePeriodS * p.index; };
  for (std::size_t i = 0; i < points_.size() / 2; ++i) {
    points_[i] = std::min(points_[2 * i], points_[2 * i + 1],
                          [&](const Point& a, const Point& b) { return lateness(a) < lateness(b); });
  }
  points_.resize(points_.size() / 2);
  block_ *= 2;
}

ClockFit ClockEstimator::fit() const {
  ClockFit fit;
  if (points_.size() < 8) {
    const Point first = points_.empty() ? earliest_ : points_.front();
    fit.offset_s = first.arrival - fit.period_s * first.index;
    return fit;
  }
  std::vector<bool> used(points_.size(), true);
  Line line = least_squares(points_, used);
  std::vector<double> deviation(points_.size());
  const auto off = [&](std::size_t i) {
    return points_[i].arrival - line.intercept - line.slope * points_[i].index;
  };
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < points_.size(); ++i) deviation[i] = std::abs(off(i));
    std::vector<double> sorted = deviation;
    const double most = std::max(3 * median(sorted), 1e-9);
    for (std::size_t i = 0; i < points_.size(); ++i) used[i] = deviation[i] <= most;
    line = least_squares(points_, used);
  }
  double squares = 0, n = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!used[i]) continue;
    squares += off(i) * off(i);
    n += 1;
  }
  fit.period_s = line.slope;
  fit.offset_s = line.intercept;
  fit.residual_s = std::sqrt(squares / n);
  fit.measured_s = line.slope;
  fit.plausible = std::abs(line.slope / rig::kFramePeriodS - 1) <= 0.005;
  if (!fit.plausible) {
    fit.period_s = rig::kFramePeriodS;
    fit.offset_s = points_.front().arrival - fit.period_s * points_.front().index;
    for (const Point& p : points_) fit.offset_s = std::min(fit.offset_s, p.arrival - fit.period_s * p.index);
  }
  return fit;
}

GapCounter::GapCounter(double period_s, std::size_t lookahead) : period_(period_s), lookahead_(lookahead) {}

void GapCounter::push(double arrival_s, std::vector<std::uint32_t>& missing_before) {
  const double late = arrival_s - period_ * static_cast<double>(pushed_);
  if (pushed_ == 0) envelope_ = late;
  waiting_.push_back(late);
  while (!minimum_.empty() && minimum_.back().second >= late) minimum_.pop_back();
  minimum_.emplace_back(pushed_++, late);
  if (waiting_.size() >= lookahead_) decide(missing_before);
}

void GapCounter::finish(std::vector<std::uint32_t>& missing_before) {
  while (!waiting_.empty()) decide(missing_before);
}

void GapCounter::decide(std::vector<std::uint32_t>& missing_before) {
  // Before the first decision the envelope is the earliest of everything seen: the first frame may be a late
  // one.
  if (decided_ == 0) envelope_ = minimum_.front().second;
  const double periods = std::floor((minimum_.front().second - envelope_) / period_ + kEarly);
  const std::uint64_t total = std::max(missing_, static_cast<std::uint64_t>(std::max(periods, 0.0)));
  missing_before.push_back(static_cast<std::uint32_t>(total - missing_));
  missing_ = total;
  track(waiting_.front() - envelope_ - period_ * static_cast<double>(missing_));
  waiting_.pop_front();
  if (minimum_.front().first == decided_) minimum_.pop_front();
  ++decided_;
}

// The board's crystal is not exactly the assumed one: the envelope follows the earliest frame of every block.
void GapCounter::track(double lateness) {
  block_minimum_ = in_block_ == 0 ? lateness : std::min(block_minimum_, lateness);
  if (++in_block_ < kTrackBlock) return;
  in_block_ = 0;
  if (std::abs(block_minimum_) < 0.5 * period_) envelope_ += 0.5 * block_minimum_;
}

namespace {

// A host that did not read finds the oldest frames in the tty, all at once; what is missing vanished behind
// them.
void place_behind_bursts(std::span<const double> arrivals, std::vector<std::uint32_t>& missing_before) {
  std::vector<std::uint32_t> placed = missing_before;
  for (std::size_t i = 1; i < arrivals.size(); ++i) {
    if (missing_before[i] == 0) continue;
    std::size_t end = i + 1;
    while (end < arrivals.size() && arrivals[end] - arrivals[end - 1] < 0.5 * rig::kFramePeriodS) ++end;
    if (end < i + 3 || end == arrivals.size()) continue;
    placed[i] -= missing_before[i];
    placed[end] += missing_before[i];
  }
  missing_before = std::move(placed);
}

}  // namespace

FrameTimeline timeline_of(std::span<const double> arrivals) {
  FrameTimeline timeline;
  // Once with the nominal period and a short view, then with the period found and a long one.
  for (const std::size_t lookahead : {std::size_t{64}, std::size_t{1024}}) {
    GapCounter gaps(timeline.clock.period_s, lookahead);
    std::vector<std::uint32_t> missing_before;
    for (const double arrival : arrivals) gaps.push(arrival, missing_before);
    gaps.finish(missing_before);
    place_behind_bursts(arrivals, missing_before);
    ClockEstimator estimator;
    timeline.index.clear();
    std::uint64_t index = 0;
    for (std::size_t i = 0; i < arrivals.size(); ++i) {
      index += missing_before[i] + (i == 0 ? 0 : 1);
      timeline.index.push_back(index);
      estimator.add(index, arrivals[i]);
    }
    timeline.missing = gaps.missing();
    timeline.clock = estimator.fit();
  }
  return timeline;
}

bool JumpDetector::jump(const BoardFrame& frame) {
  bool far = false;
  for (int k = 0; k < rig::kTaxels && !first_; ++k) {
    far = far || std::abs(frame.taxel(k) - last_[static_cast<std::size_t>(k)]) > limit_;
  }
  first_ = false;
  // Three in a row are a change of the world, not of a byte.
  const bool flag = far && flagged_ < 3;
  flagged_ = flag ? flagged_ + 1 : 0;
  if (!flag) {
    for (int k = 0; k < rig::kTaxels; ++k) last_[static_cast<std::size_t>(k)] = frame.taxel(k);
  }
  return flag;
}

}  // namespace supertac
