// The board's frames have neither numbers nor time stamps. Its clock is recovered from arrival times: a frame
// can arrive late but never early, so the board's ticks are the lower envelope of the arrivals. Adapters hand
// frames on in chunks, and a host that stood still finds in one burst what its port could hold; frames near
// such a loss can be dated within bounds only, which are kept with them. Live and collected frames are
// counted by the same rules.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "data/frames/board_frame.h"

namespace supertac {

/// arrival(index) = offset + period * index + delay, delay >= 0.
struct ClockFit {
  double period_s = rig::kFramePeriodS;
  double offset_s = 0;
  double measured_s = rig::kFramePeriodS;  ///< the period that the arrivals say
  bool plausible = true;  ///< measured_s within 0.5 % of the nominal one; otherwise frames were
                          ///< miscounted or it is another board, and period_s is the nominal one
  double at(double index) const { return offset_s + period_s * index; }
};

/// Robust line under the arrivals: the earliest of every block of frames, then least squares that gives up
/// points more than three median deviations away, three times. Memory is bounded: blocks are merged as they
/// grow in number.
class ClockEstimator {
 public:
  /// `tolerance`: what is plausible, a share of the nominal period.
  explicit ClockEstimator(double period_s = rig::kFramePeriodS, double tolerance = 0.005)
      : period_(period_s), tolerance_(tolerance) {}
  /// To be called for the last frame of a read only: those before it have waited in the port.
  void add(double index, double arrival_s);
  /// Before there are 8 blocks of 16 frames: the nominal period, in a line below all arrivals.
  ClockFit fit() const;

 private:
  struct Point {
    double index, arrival;
  };
  void close_block();
  double lateness(const Point& point) const { return point.arrival - period_ * point.index; }
  double period_, tolerance_;
  std::vector<Point> points_;
  Point earliest_{};
  std::uint64_t in_block_ = 0, block_ = 16;
};

/// A frame as it came.
struct FrameArrival {
  double time_s = 0;          ///< when the read that brought it returned; one time for all of a read
  std::uint32_t damaged = 0;  ///< frames between the one before and this one that came, but not whole
  bool more_waited = false;   ///< the read took as much as a terminal holds, and may have left more
};

/// How many frames the `discarded` bytes between two whole frames were. A byte or two too many or too few are
/// a cable's errors.
std::uint32_t damaged_frames(std::uint64_t discarded);
/// A read of more bytes may have left some behind: a terminal holds 4,095.
constexpr std::size_t kTerminalFull = 4096 - rig::kFrameBytes;

/// Whether `frames` that came `seconds` after a read had emptied the port are more than the board makes in
/// that time: then they had waited, too, and belong to the burst before.
bool belongs_to_burst(double frames, double seconds, double period_s);

/// A frame's place among all that the board made.
struct FramePlace {
  std::uint64_t index = 0;
  std::uint32_t doubt = 0;  ///< it may be wrong by so many frames: some were lost about here
};

/// Numbers the frames, the missing ones counted. A lost frame makes every later arrival late by a period for
/// good; the burst that follows a delay makes up for it. So the frames missing at a burst are the whole
/// periods by which ALL of the bursts that follow are late (at least 8 bursts and `lookahead` frames). They
/// were lost before a burst of a single frame, and behind any other, when the port was full.
class FrameNumbering {
 public:
  explicit FrameNumbering(double period_s = rig::kFramePeriodS, std::size_t lookahead = 64);
  /// Appends to `places` those of all frames that have become certain.
  void push(const FrameArrival& arrival, std::vector<FramePlace>& places);
  /// All frames still uncertain, at the end of the stream.
  void finish(std::vector<FramePlace>& places);
  /// Lost or damaged between the first frame and the last.
  std::uint64_t missing() const { return missing_ + damaged_; }

 private:
  struct Burst {
    double time_s = 0;       // of its last read
    std::uint64_t last = 0;  // its last frame, counted with the damaged ones
    bool more_waited = false;
    std::vector<std::uint32_t> steps;  // from frame to frame
  };
  double lateness(const Burst& burst) const {
    return burst.time_s - period_ * static_cast<double>(burst.last);
  }
  void close_read();
  double least_lateness() const;  // of all bursts not yet decided
  void decide(std::vector<FramePlace>& places);
  void track(double lateness);

  double period_;
  std::size_t lookahead_;
  Burst read_;                // the read whose frames come now
  std::deque<Burst> bursts_;  // not yet decided
  // Increasing lateness, the smallest in front, of all bursts but the last, which may still grow.
  std::deque<std::pair<std::uint64_t, double>> minimum_;
  std::uint64_t closed_ = 0, decided_ = 0;  // bursts
  std::size_t waiting_ = 0;                 // frames in bursts_
  std::uint64_t counted_ = 0, missing_ = 0, damaged_ = 0, index_ = 0;
  std::uint32_t doubt_ = 0;  // of what comes next
  double decided_s_ = 0;     // when the newest decided burst was read, and its last frame
  std::uint64_t decided_last_ = 0;
  double envelope_ = 0, block_minimum_ = 0;
  int in_block_ = 0;
};

/// Dates frames as they come, by the same rules without a look ahead: a period apart, at the latest when they
/// are read. Dates jump when frames were lost: at once when two reads of a port that had been empty are both
/// 16 periods late, else when all of a quarter of a second were late.
class LiveDates {
 public:
  /// When the board finished a read's frames (`steps` from frame to frame, damaged ones counted). Increasing.
  void date(double time_s, bool more_waited, std::span<const std::uint32_t> steps,
            std::vector<double>& dates);

 private:
  double last_s_ = 0, read_s_ = 0;  // the newest frame; the newest read
  double late_s_ = 0;               // of the read before
  double least_late_s_ = 0, block_began_s_ = 0;
  bool first_ = true, more_waited_ = false;
};

/// Place of every frame of a stream, and the clock behind them.
struct FrameTimeline {
  std::vector<FramePlace> places;
  ClockFit clock;
  std::uint64_t missing = 0;
};
FrameTimeline timeline_of(std::span<const FrameArrival> arrivals);

/// Flags physically implausible jumps: a taxel that moves more than 124 ADC steps between two frames. A
/// flipped bit in a sample passes every check of the format; only this can show it.
class JumpDetector {
 public:
  bool jump(const BoardFrame& frame);

 private:
  static constexpr int kLimit = 124;  // 0.1 V in a period: at 10 mm/s the finger has moved 0.01 mm
  std::array<int, rig::kTaxels> last_{};
  int flagged_ = 0;
  bool first_ = true;
};

}  // namespace supertac
