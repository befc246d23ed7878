// A rig for everyone without one: a tactile board whose finger feels what is under it, and a plain Marlin
// that carries it. Rigs that misbehave are the tests'.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "data/frames/binary_decoder.h"

namespace supertac {

/// The planner of a printer: straight moves with acceleration, one after the other, each stopping at its end.
/// A move that finds the queue empty starts late.
class MotionQueue {
 public:
  /// `slowness`: moves take this many times as long.
  MotionQueue(const Point3& start, double start_delay_s, double slowness, double acceleration)
      : rest_(start), start_delay_s_(start_delay_s), slowness_(slowness), acceleration_(acceleration) {}

  /// Where the head is at time t. Forgets moves that ended before t, so t may not go backwards.
  Point3 at(double t);
  /// The end of the last move.
  Point3 target() const { return blocks_.empty() ? rest_ : blocks_.back().to; }
  /// When the last move ends; in the past when the head stands.
  double end_time() const { return end_; }
  /// At this speed, or as fast as z goes.
  void move_to(const Point3& to, double speed_mm_s, double t);
  /// Up, across, and down to 0, 0, 0.
  void home(double t);
  /// Stops dead; returns where.
  Point3 stop(double t);

 protected:
  struct Block {
    Point3 from, to;
    double start, end;
  };
  Point3 rest_;
  double start_delay_s_, slowness_, acceleration_;
  double end_ = -1;
  std::deque<Block> blocks_;
};

/// Printer and board in one world with one time, which its owner lets pass. No threads and no clock.
class RigAtPorts {
 public:
  virtual ~RigAtPorts() = default;
  /// Runs printer and board until time t (s), in the order of their events.
  virtual void advance(double t) = 0;
  /// The next time at which something happens by itself.
  virtual double next_event() const = 0;
  /// Bytes from the host to the printer, arriving now, and those that left the printer since.
  virtual void to_printer(std::span<const std::byte> bytes) = 0;
  virtual std::vector<std::byte> from_printer() = 0;

  /// Takes the board's bytes at time t; returns how many of them the host takes.
  std::function<std::size_t(std::span<const std::byte>, double t)> board_sink;
};

/// The taxels' voltages when the finger's centre is at (x, y, z) mm of the printer at time t (s).
using TaxelVolts = std::array<double, rig::kTaxels>;
using FingerSignals = std::function<TaxelVolts(double x, double y, double z, double t)>;
/// As the board sends them; the other patches are at rest.
BoardFrame frame_of(const TaxelVolts& volts);

/// The number behind a letter, as Marlin's parser reads it.
std::optional<double> parameter(const std::string& command, std::string_view name);

/// How Marlin takes lines: each number once and in order, with a checksum. M110 sets the number.
struct NumberedLines {
  struct Taken {
    std::optional<std::string> command;  ///< without number and checksum; none where the line must not run
    std::string complaint;               ///< why; empty of a line that is ignored
  };
  std::int64_t last = 0;
  bool ignores_repetitions = true;  ///< since 2.1.2; before, it complained of their number

  Taken take(const std::string& received);
  std::string complaint(const std::string& what) const;
};

/// The board at its nominal rate. A running Marlin with an emergency parser, the head at rig::kMounted, that
/// knows G0, G1, G28, G92, M105, M108, M110, M112, M114 (R), M115, M400 and M410, in mm and absolute.
class PlainRig : public RigAtPorts {
 public:
  PlainRig(FingerSignals signals, double t);
  void advance(double t) override;
  double next_event() const override;
  void to_printer(std::span<const std::byte> bytes) override;
  std::vector<std::byte> from_printer() override;

 private:
  void take_line(const std::string& line);
  void run_waiting();
  std::string answer_to(const std::string& command);
  Point3 place_in(const std::string& command) const;
  void move(const std::string& command);
  void send_frame();
  double next_frame() const { return start_s_ + static_cast<double>(frames_ + 1) * rig::kFramePeriodS; }

  FingerSignals signals_;
  MotionQueue motion_;
  double start_s_, now_s_;
  std::optional<double> held_until_s_;  // by the command that runs
  Point3 zero_;                         // logical = physical - zero
  double feed_mm_s_ = rig::kSlideMmS;
  NumberedLines lines_;
  std::deque<std::string> waiting_;  // commands
  std::string partial_, output_;
  std::uint64_t frames_ = 0;
  bool halted_ = false;
};

/// The master side of a pseudo-terminal, its slave side linked at `link`.
class PseudoTerminal {
 public:
  /// An existing symbolic link at `link` is replaced, anything else is refused. Throws PortError.
  explicit PseudoTerminal(const std::string& link);
  ~PseudoTerminal();
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  int descriptor() const { return master_; }
  const std::string& path() const { return slave_; }
  /// Pulls the plug: the other side sees end of file.
  void unplug();

 private:
  std::string link_, slave_;
  int master_ = -1, keep_open_ = -1;
};

/// A rig behind two pseudo-terminals, linked at the given paths: any program that talks to a serial port can
/// talk to it, through the kernel's terminal driver as with the real thing.
class PtyRig {
 public:
  /// Runs at `speedup` times the wall clock until destroyed. `rig` begins at now(speedup).
  PtyRig(std::unique_ptr<RigAtPorts> rig, const std::string& board_link, const std::string& printer_link,
         double speedup = 1);
  static double now(double speedup);
  ~PtyRig();

 protected:
  std::mutex mutex_;  // of the rig and its ports
  PseudoTerminal board_, printer_;
  std::unique_ptr<RigAtPorts> rig_;

 private:
  void run();
  std::size_t send_frame(std::span<const std::byte> bytes);
  void serve_printer();

  double speedup_;
  std::vector<std::byte> printer_out_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace supertac
