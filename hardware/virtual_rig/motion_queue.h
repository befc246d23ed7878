// The planner of the virtual printer: straight moves with acceleration, one after the other, each stopping
// at its end. A move that finds the queue empty starts late.
#pragma once

#include <cstddef>
#include <deque>

#include "data/sensors/rig.h"

namespace supertac {

class MotionQueue {
 public:
  static constexpr std::size_t kBlocks = 16;

  /// `slowness`: moves take this many times as long.
  MotionQueue(const Point3& start, double start_delay_s, double slowness, double acceleration)
      : rest_(start), start_delay_s_(start_delay_s), slowness_(slowness), acceleration_(acceleration) {}

  /// Where the head is at time t. Forgets moves that ended before t, so t may not go backwards.
  Point3 at(double t);
  /// The end of the last move.
  Point3 target() const { return blocks_.empty() ? rest_ : blocks_.back().to; }
  /// When the last move ends; in the past when the head stands.
  double end_time() const { return end_; }
  /// When the move now running ends; end_time() when none runs.
  double next_end() const { return blocks_.empty() ? end_ : blocks_.front().end; }
  bool full(double t);
  /// At this speed, or as fast as z goes.
  void move_to(const Point3& to, double speed_mm_s, double t);
  /// Up, across, and down to 0, 0, 0.
  void home(double t);
  /// Stands for so long, then goes on.
  void hold(double t, double seconds);
  /// Stops dead; returns where.
  Point3 stop(double t);

 private:
  struct Block {
    Point3 from, to;
    double start, end;
  };
  Point3 rest_;
  double start_delay_s_, slowness_, acceleration_;
  double end_ = -1;
  std::deque<Block> blocks_;
};

}  // namespace supertac
