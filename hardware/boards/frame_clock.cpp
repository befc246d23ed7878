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
constexpr std::size_t kLeastBursts = 8;
constexpr int kTrackBlock = 32;
constexpr double kLostAtOnce = 16;  // periods
constexpr double kLiveBlockS = 0.25;
constexpr std::uint32_t kAnything = 1'000'000'000;  // doubt of frames that waited before anybody looked

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

void ClockEstimator::add(double index, double arrival_s) {
  const Point point{index, arrival_s};
  if (in_block_ == 0 || lateness(point) < lateness(earliest_)) earliest_ = point;
  if (++in_block_ >= block_) close_block();
}

void ClockEstimator::close_block() {
  points_.push_back(earliest_);
  in_block_ = 0;
  if (points_.size() < kMostPoints) return;
  for (std::size_t i = 0; i < points_.size() / 2; ++i) {
    points_[i] = std::min(points_[2 * i], points_[2 * i + 1],
                          [this](const Point& a, const Point& b) { return lateness(a) < lateness(b); });
  }
  points_.resize(points_.size() / 2);
  block_ *= 2;
}

ClockFit ClockEstimator::fit() const {
  ClockFit fit{.period_s = period_, .measured_s = period_};
  const auto nominal_offset = [this] {
    double offset = lateness(earliest_);
    for (const Point& p : points_) offset = std::min(offset, lateness(p));
    return offset;
  };
  if (points_.size() < 8) {
    fit.offset_s = nominal_offset();
    return fit;
  }
  std::vector<bool> used(points_.size(), true);
  Line line = least_squares(points_, used);
  std::vector<double> deviation(points_.size());
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < points_.size(); ++i)
      deviation[i] = std::abs(points_[i].arrival - line.intercept - line.slope * points_[i].index);
    std::vector<double> sorted = deviation;
    const double most = std::max(3 * median(sorted), 1e-9);
    for (std::size_t i = 0; i < points_.size(); ++i) used[i] = deviation[i] <= most;
    line = least_squares(points_, used);
  }
  fit.period_s = line.slope;
  fit.offset_s = line.intercept;
  fit.measured_s = line.slope;
  fit.plausible = std::abs(line.slope / period_ - 1) <= tolerance_;
  if (!fit.plausible) {
    fit.period_s = period_;
    fit.offset_s = nominal_offset();
  }
  return fit;
}

std::uint32_t damaged_frames(std::uint64_t discarded) {
  return static_cast<std::uint32_t>((discarded + rig::kFrameBytes - 1 - 8) / rig::kFrameBytes);
}

bool belongs_to_burst(double frames, double seconds, double period_s) {
  return frames - seconds / period_s > 0.5 + 0.02 * frames;
}

FrameNumbering::FrameNumbering(double period_s, std::size_t lookahead)
    : period_(period_s), lookahead_(lookahead) {}

void FrameNumbering::push(const FrameArrival& arrival, std::vector<FramePlace>& places) {
  if (!read_.steps.empty() && arrival.time_s != read_.time_s) close_read();
  const bool first = counted_ == 0;
  const std::uint32_t damaged = first ? 0 : arrival.damaged;
  counted_ += 1 + damaged;
  damaged_ += damaged;
  read_.time_s = arrival.time_s;
  read_.last = counted_;
  read_.more_waited = arrival.more_waited;
  read_.steps.push_back(first ? 0 : 1 + damaged);
  while (bursts_.size() > kLeastBursts && waiting_ - bursts_.front().steps.size() >= lookahead_)
    decide(places);
}

void FrameNumbering::close_read() {
  Burst read;
  std::swap(read, read_);
  const bool joins =
      !bursts_.empty() &&
      (bursts_.back().more_waited || belongs_to_burst(static_cast<double>(read.last - bursts_.back().last),
                                                      read.time_s - bursts_.back().time_s, period_));
  waiting_ += read.steps.size();
  if (joins) {
    Burst& burst = bursts_.back();
    burst.steps.insert(burst.steps.end(), read.steps.begin(), read.steps.end());
    burst.time_s = read.time_s, burst.last = read.last, burst.more_waited = read.more_waited;
    return;
  }
  if (!bursts_.empty()) {
    const double late = lateness(bursts_.back());
    while (!minimum_.empty() && minimum_.back().second >= late) minimum_.pop_back();
    minimum_.emplace_back(closed_++, late);
  }
  bursts_.push_back(std::move(read));
}

double FrameNumbering::least_lateness() const {
  const double last = lateness(bursts_.back());
  return minimum_.empty() ? last : std::min(last, minimum_.front().second);
}

void FrameNumbering::finish(std::vector<FramePlace>& places) {
  if (!read_.steps.empty()) close_read();
  while (!bursts_.empty()) decide(places);
}

void FrameNumbering::decide(std::vector<FramePlace>& places) {
  const double least = least_lateness();
  const Burst burst = std::move(bursts_.front());
  bursts_.pop_front();
  waiting_ -= burst.steps.size();
  // Before the first decision the envelope is the earliest of everything seen: the first may be a late one.
  if (decided_ == 0) envelope_ = least;
  const double periods = std::floor((least - envelope_) / period_ + kEarly);
  const std::uint64_t total = std::max(missing_, static_cast<std::uint64_t>(std::max(periods, 0.0)));
  const std::uint64_t lost = total - missing_;
  const bool alone = burst.steps.size() == 1;
  // That a last burst is late proves no loss: what would have made it good did not come.
  if (alone || !bursts_.empty()) missing_ = total;
  // What waited among lost frames may be any of them, up to a burst that has all frames of its time and is
  // not late. The first of that one may still be half an old frame.
  const double made = (burst.time_s - decided_s_) / period_;
  const double late = lateness(burst) - envelope_ - period_ * static_cast<double>(missing_);
  const bool settled =
      static_cast<double>(burst.last - decided_last_) > 0.9 * made - 1.5 && late < 1.5 * period_;
  doubt_ = static_cast<std::uint32_t>(std::min<std::uint64_t>(doubt_ + lost, kAnything));
  if (decided_ == 0 && !alone) doubt_ = kAnything;
  if (alone) index_ += lost;
  for (const std::uint32_t step : burst.steps) {
    index_ += step;
    places.push_back({index_, doubt_});
    if (lost == 0 && settled && decided_ > 0) doubt_ = 0;
  }
  if (!alone) index_ += lost;
  decided_s_ = burst.time_s;
  decided_last_ = burst.last;
  track(late);
  if (!minimum_.empty() && minimum_.front().first == decided_) minimum_.pop_front();
  ++decided_;
}

// The board's crystal is not exactly the assumed one: the envelope follows the earliest of every block.
void FrameNumbering::track(double late) {
  block_minimum_ = in_block_ == 0 ? late : std::min(block_minimum_, late);
  if (++in_block_ < kTrackBlock) return;
  in_block_ = 0;
  if (std::abs(block_minimum_) < 0.5 * period_) envelope_ += 0.5 * block_minimum_;
}

void LiveDates::date(double time_s, bool more_waited, std::span<const std::uint32_t> steps,
                     std::vector<double>& dates) {
  dates.clear();
  if (steps.empty()) return;
  const double period = rig::kFramePeriodS;
  double count = 0;
  for (const std::uint32_t step : steps) count += step;
  if (first_) last_s_ = time_s - count * period, block_began_s_ = time_s, least_late_s_ = late_s_ = 0;
  const double late = time_s - last_s_ - count * period;
  const bool fresh = !first_ && !more_waited_ && !belongs_to_burst(count, time_s - read_s_, period);
  if (fresh && std::min(late, late_s_) > kLostAtOnce * period) {
    last_s_ += std::min(late, late_s_);
  } else if (time_s - block_began_s_ > kLiveBlockS) {
    last_s_ += std::max(0.0, std::min(late, least_late_s_));
    least_late_s_ = late, block_began_s_ = time_s;
  }
  const double step_s = std::min(period, (time_s - last_s_) / count);
  for (const std::uint32_t step : steps) dates.push_back(last_s_ += step * step_s);
  late_s_ = time_s - last_s_;
  least_late_s_ = std::min(least_late_s_, late_s_);
  read_s_ = time_s;
  first_ = false, more_waited_ = more_waited;
}

FrameTimeline timeline_of(std::span<const FrameArrival> arrivals) {
  FrameTimeline timeline;
  // Once with the nominal period and a short view, then with the period found and a long one.
  for (const std::size_t lookahead : {std::size_t{64}, std::size_t{1024}}) {
    FrameNumbering numbering(timeline.clock.period_s, lookahead);
    timeline.places.clear();
    for (const FrameArrival& arrival : arrivals) numbering.push(arrival, timeline.places);
    numbering.finish(timeline.places);
    ClockEstimator estimator;
    for (std::size_t i = 0; i < arrivals.size(); ++i) {
      const bool last = i + 1 == arrivals.size() || arrivals[i + 1].time_s != arrivals[i].time_s;
      if (last && timeline.places[i].doubt == 0)
        estimator.add(static_cast<double>(timeline.places[i].index), arrivals[i].time_s);
    }
    timeline.missing = numbering.missing();
    timeline.clock = estimator.fit();
  }
  return timeline;
}

bool JumpDetector::jump(const BoardFrame& frame) {
  bool far = false;
  for (int k = 0; k < rig::kTaxels && !first_; ++k) {
    far = far || std::abs(frame.taxel(k) - last_[static_cast<std::size_t>(k)]) > kLimit;
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
