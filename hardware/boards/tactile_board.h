// The live board: a thread reads and decodes, a bounded queue hands frames over. The reader never waits for
// its consumer (but for replays), so a slow consumer loses the oldest frames; a counter says how many.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "data/frames/frame_decoder.h"
#include "hardware/boards/frame_clock.h"
#include "hardware/boards/frame_queue.h"
#include "hardware/ports/port.h"

namespace supertac {

struct StampedFrame {
  BoardFrame frame;
  FrameArrival arrival;
  double time_s = 0;     ///< when the board finished the frame, as far as that is known at once (LiveDates)
  bool suspect = false;  ///< first after a pause of 1.5 periods or after discarded bytes: may be torn
  bool jump = false;     ///< implausible change of a taxel
};

struct BoardSettings {
  std::size_t queue_frames = 4096;
  bool wait_for_consumer = false;  ///< a full queue holds the reader up and drops nothing: for replays
  double silence_s = 1;            ///< without a frame for so long: BoardSilent
};

struct BoardCounters {
  FrameDecoder::Counters decoder;
  std::uint64_t dropped = 0;  ///< frames the consumer was too slow for
  /// Frames that did not arrive whole, counted from the times; the newest are undecided until the reader
  /// ends.
  std::uint64_t missing = 0;
  std::uint64_t suspect = 0;
  std::uint64_t jumps = 0;
  ClockFit clock;
};

/// What ends it is PortUnplugged, BoardSilent or WrongDevice.
class TactileBoard : public FrameQueue<StampedFrame> {
 public:
  /// Starts to read `port`.
  explicit TactileBoard(std::unique_ptr<Port> port, const BoardSettings& settings = {});
  /// Stops reading; frames that already arrived at the port are still read.
  ~TactileBoard() { stop(); }
  BoardCounters counters();

 private:
  void run();
  void read_once(double until);
  void take_batch(double time, bool more_waited);
  void take(StampedFrame frame);
  void keep_decided();
  void check_silence(double time);

  std::unique_ptr<Port> port_;
  double silence_s_;
  BoardCounters counters_;
  ClockEstimator clock_;

  // of the reader's thread alone
  FrameDecoder decoder_;
  FrameNumbering numbering_;
  LiveDates live_;
  JumpDetector jumps_;
  struct Decoded {
    BoardFrame frame;
    std::uint64_t discarded;
  };
  std::vector<Decoded> batch_;  // of one read
  std::vector<std::uint32_t> steps_;
  std::vector<double> dates_;
  struct Undecided {
    double time_s;
    bool last;  // of its read
  };
  std::deque<Undecided> undecided_;
  std::vector<FramePlace> places_;
  double last_arrival_ = 0;
  bool first_ = true;
  double text_bytes_ = 0;
};

}  // namespace supertac
