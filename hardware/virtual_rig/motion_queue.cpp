#include "hardware/virtual_rig/motion_queue.h"

#include <algorithm>
#include <cmath>

#include "hardware/printers/marlin_line.h"
#include "hardware/printers/motion_model.h"

namespace supertac {

Point3 MotionQueue::at(double t) {
  while (!blocks_.empty() && t >= blocks_.front().end) {
    rest_ = blocks_.front().to;
    blocks_.pop_front();
  }
  if (blocks_.empty() || t <= blocks_.front().start) return rest_;
  const Block& block = blocks_.front();
  const double length = distance(block.from, block.to);
  const double done = trapezoid_position(t - block.start, length, block.end - block.start, acceleration_);
  return between(block.from, block.to, length > 0 ? done / length : 1);
}

bool MotionQueue::full(double t) {
  (void)at(t);
  return blocks_.size() >= kBlocks;
}

void MotionQueue::move_to(const Point3& to, double speed_mm_s, double t) {
  rest_ = blocks_.empty() ? at(t) : rest_;
  const Point3 from = target();
  if (from == to) return;
  const double start = blocks_.empty() ? t + start_delay_s_ : blocks_.back().end;
  const double length = distance(from, to), rise = std::abs(to.z - from.z);
  const double speed = rise > 0 ? std::min(speed_mm_s, rig::kLiftMmS * length / rise) : speed_mm_s;
  end_ = start + slowness_ * trapezoid_duration(length, speed, acceleration_);
  blocks_.push_back({from, to, start, end_});
}

void MotionQueue::home(double t) {
  const Point3 at = target();
  move_to({at.x, at.y, at.z + 5}, rig::kLiftMmS, t);
  move_to({0, 0, at.z + 5}, rig::kFastestMmS, t);
  move_to({}, rig::kLiftMmS, t);
}

void MotionQueue::hold(double t, double seconds) {
  rest_ = at(t);
  if (blocks_.empty()) return;
  for (Block& block : blocks_) {
    block.start += seconds;
    block.end += seconds;
  }
  end_ += seconds;
  Block& running = blocks_.front();
  if (running.start - seconds >= t) return;
  running = {rest_, running.to, t + seconds, running.end};
}

Point3 MotionQueue::stop(double t) {
  rest_ = at(t);
  blocks_.clear();
  end_ = t;
  return rest_;
}

}  // namespace supertac
