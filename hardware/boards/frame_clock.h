// The board numbers nothing and stamps nothing. What its clock said is recovered from arrival times: a frame
// can arrive late but never early, so the board's ticks are the lower envelope of the arrivals.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "hardware/boards/board_frame.h"

namespace supertac {

/// arrival(index) = offset + period * index + delay, delay >= 0.
struct ClockFit {
  double period_s = rig::kFramePeriodS;
  double offset_s = 0;
  double residual_s = 0;                   ///< RMS of the envelope's points about the line
  double measured_s = rig::kFramePeriodS;  ///< the period that the arrivals say
  bool plausible = true;  ///< measured_s within 0.5 % of the nominal one; otherwise frames were
                          ///< miscounted or it is another board, and period_s is the nominal one
  double at(double index) const { return offset_s + period_s * index; }
};

/// Robust line under the arrivals: the earliest frame of every block, then least squares that gives up points
/// more than three median deviations away, three times. Memory is bounded: blocks are merged as they grow in
/// number.
class ClockEstimator {
 public:
  void add(std::uint64_t index, double arrival_s);
  /// Nominal period through the first frame until there are 8 blocks of 64 frames.
  ClockFit fit() const;

 private:
  struct Point {
    double index, arrival;
  };
  void close_block();
  std::vector<Point> points_;
  Point earliest_{};
  std::uint64_t in_block_ = 0, block_ = 64;
};

/// Counts missing frames from arrival times. A lost frame moves every later arrival up by a period for good;
/// a delay is made good by the burst that follows. So the frames missing before frame i are the whole periods
/// by which ALL of the next `lookahead` frames are late.
class GapCounter {
 public:
  explicit GapCounter(double period_s = rig::kFramePeriodS, std::size_t lookahead = 64);
  /// Appends to `missing_before` one number for every frame that has become certain.
  void push(double arrival_s, std::vector<std::uint32_t>& missing_before);
  /// All frames still uncertain, at the end of the stream.
  void finish(std::vector<std::uint32_t>& missing_before);
  std::uint64_t missing() const { return missing_; }

 private:
  void decide(std::vector<std::uint32_t>& missing_before);
  void track(double lateness);

  double period_;
  std::size_t lookahead_;
  std::deque<double> waiting_;                            // arrival - period * number, not yet decided
  std::deque<std::pair<std::uint64_t, double>> minimum_;  // increasing: the smallest of waiting_ is in front
  std::uint64_t pushed_ = 0, decided_ = 0, missing_ = 0;
  double envelope_ = 0;
  double block_minimum_ = 0;
  int in_block_ = 0;
};

/// Index (from 0, gaps counted) of every frame, and the clock behind them, from all arrivals of a stream.
struct FrameTimeline {
  std::vector<std::uint64_t> index;
  ClockFit clock;
  std::uint64_t missing = 0;
};
FrameTimeline timeline_of(std::span<const double> arrivals);

/// Flags physically implausible jumps: a taxel that moves more than `limit` ADC steps between two frames. A
/// flipped bit in a sample passes every check of the format; this is all that can be said about it.
class JumpDetector {
 public:
  /// 0.1 V in a period: at 10 mm/s the finger has moved 0.01 mm.
  explicit JumpDetector(int limit = 124) : limit_(limit) {}
  bool jump(const BoardFrame& frame);

 private:
  int limit_;
  std::array<int, rig::kTaxels> last_{};
  int flagged_ = 0;
  bool first_ = true;
};

}  // namespace supertac
