#include <algorithm>
#include <chrono>

#include "hardware/ports/errors.h"
#include "tests/hardware/rig_support.h"

namespace supertac {
namespace {

constexpr double kByteSeconds = 10.0 / rig::kPrinterBaud;
// The reader's thread may be this many frames behind simulated time.
constexpr std::size_t kMostChunks = 64;
// Arrival is never exactly on time: a USB frame of 125 us and the host's wake-up.
constexpr double kUsbLatency = 0.0002;

}  // namespace

class SimulatedRig::PrinterPort : public FakePort {
 public:
  explicit PrinterPort(SimulatedRig& rig) : rig_(rig) { name_ = "simulated printer"; }
  double now() override { return rig_.now(); }

  Received read(std::span<std::byte> buffer, double until) override {
    std::unique_lock lock(rig_.mutex_);
    rig_.maybe_freeze(lock);
    for (;;) {
      check();
      said_ += as_text(rig_.world_.from_printer());
      if (!said_.empty()) break;
      if (rig_.world_.now() >= until) return {0, rig_.world_.now()};
      // A step at a time, so that an answer is seen when it is given.
      const double event = rig_.world_.printer().next_event();
      rig_.advance(lock, std::min(until, std::max(event, rig_.world_.now())));
    }
    rig_.maybe_freeze(lock);
    now_ = rig_.world_.now();
    return hand_on(buffer);
  }

  double write(std::span<const std::byte> bytes, double) override {
    std::unique_lock lock(rig_.mutex_);
    rig_.maybe_freeze(lock);
    check();
    rig_.advance(lock, rig_.world_.now() + static_cast<double>(bytes.size()) * kByteSeconds);
    rig_.world_.to_printer(bytes);
    rig_.maybe_freeze(lock);
    return rig_.world_.now();
  }

 private:
  void check() const {
    if (rig_.printer_gone_)
      throw PortUnplugged("port simulated printer: the device is gone; check the cable and start again");
  }
  SimulatedRig& rig_;
};

class SimulatedRig::BoardPort : public FakePort {
 public:
  explicit BoardPort(SimulatedRig& rig) : rig_(rig) { name_ = "simulated board"; }
  ~BoardPort() override {
    std::lock_guard lock(rig_.mutex_);
    rig_.board_listens_ = false;
    rig_.board_chunks_.clear();
    rig_.changed_.notify_all();
  }
  /// Its first use opens the port: from here on simulated time waits for the reader.
  double now() override {
    std::lock_guard lock(rig_.mutex_);
    if (!ended_) rig_.board_listens_ = true;
    return rig_.world_.now();
  }

  Received read(std::span<std::byte> buffer, double until) override {
    std::unique_lock lock(rig_.mutex_);
    rig_.changed_.wait_for(lock, std::chrono::milliseconds(50), [&] {
      return !rig_.board_chunks_.empty() || rig_.board_gone_ || rig_.world_.now() >= until;
    });
    if (rig_.board_chunks_.empty()) {
      if (rig_.board_gone_) {
        ended_ = true;
        rig_.board_listens_ = false;
        rig_.changed_.notify_all();
        throw PortUnplugged("port simulated board: the device is gone; check the cable and start again");
      }
      return {0, rig_.world_.now()};
    }
    Chunk& chunk = rig_.board_chunks_.front();
    const std::size_t count = std::min(buffer.size(), chunk.bytes.size());
    const double time = chunk.time_s;
    std::copy_n(chunk.bytes.begin(), count, buffer.begin());
    chunk.bytes.erase(chunk.bytes.begin(), chunk.bytes.begin() + static_cast<std::ptrdiff_t>(count));
    if (chunk.bytes.empty()) rig_.board_chunks_.pop_front();
    rig_.changed_.notify_all();
    return {count, time};
  }
  double write(std::span<const std::byte>, double) override { return now(); }

 private:
  SimulatedRig& rig_;
  bool ended_ = false;
};

SimulatedRig::SimulatedRig(const RigSettings& settings)
    : latency_(settings.seed, 303),
      freezes_(settings.seed, 304),
      freeze_rate_(settings.faults.host_freeze_rate),
      world_(settings, 1000.0) {
  world_.board_sink = [this](std::span<const std::byte> bytes, double t) {
    return take_board_bytes(bytes, t);
  };
}

SimulatedRig::~SimulatedRig() = default;

std::unique_ptr<Port> SimulatedRig::printer_port() { return std::make_unique<PrinterPort>(*this); }
std::unique_ptr<Port> SimulatedRig::board_port() { return std::make_unique<BoardPort>(*this); }

std::size_t SimulatedRig::take_board_bytes(std::span<const std::byte> bytes, double t) {
  if (!board_listens_ || board_gone_) return bytes.size();  // nobody looks
  if (frozen_until_ > t) return hold(bytes);
  board_time_ = std::max(board_time_, t + kUsbLatency * latency_.uniform());
  board_chunks_.push_back({board_time_, {bytes.begin(), bytes.end()}});
  return bytes.size();
}

// A port of a host that stands still: full, it takes what fits of a frame, and nothing of the next.
std::size_t SimulatedRig::hold(std::span<const std::byte> bytes) {
  const std::size_t count = std::min(bytes.size(), room_);
  room_ -= count;
  if (count > 0)
    board_chunks_.push_back(
        {frozen_until_, {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)}});
  if (count < bytes.size()) room_ = 0;
  return count;
}

// SIGSTOP: both ports' clocks go on, nothing is read. Afterwards the kernel hands on what its buffers held, a
// terminal's worth at a time.
void SimulatedRig::maybe_freeze(std::unique_lock<std::mutex>& lock) {
  if (!freezes_.hit(freeze_rate_)) return;
  constexpr std::size_t kTerminal = 4095, kTerminals = 6;
  frozen_until_ = world_.now() + 0.1 + 1.9 * freezes_.uniform();
  room_ = kTerminal * (1 + freezes_.below(kTerminals - 1)) - freezes_.below(rig::kFrameBytes);
  const std::size_t before = board_chunks_.size();
  world_.advance(frozen_until_);
  board_time_ = std::max(board_time_, frozen_until_);
  std::size_t held = 0;
  for (std::size_t i = before; i < board_chunks_.size(); ++i) {
    held += board_chunks_[i].bytes.size();
    if (held > kTerminal) held = 0, board_time_ += 5e-5 + 2e-4 * freezes_.uniform();
    board_chunks_[i].time_s = board_time_;
  }
  changed_.notify_all();
  advance(lock, board_time_);
}

void SimulatedRig::advance(std::unique_lock<std::mutex>& lock, double t) {
  // The reader must not fall behind more than a real one would: simulated time waits for it.
  changed_.wait_for(lock, std::chrono::seconds(2),
                    [&] { return !board_listens_ || (!board_gone_ && board_chunks_.size() < kMostChunks); });
  world_.advance(t);
  changed_.notify_all();
}

void SimulatedRig::run_for(double seconds) {
  std::unique_lock lock(mutex_);
  const double end = world_.now() + seconds;
  while (world_.now() < end) advance(lock, std::min(end, world_.now() + 0.1));
}

double SimulatedRig::now() {
  std::lock_guard lock(mutex_);
  return world_.now();
}

void SimulatedRig::unplug_board() {
  std::lock_guard lock(mutex_);
  board_gone_ = true;
  changed_.notify_all();
}

void SimulatedRig::unplug_printer() {
  std::lock_guard lock(mutex_);
  printer_gone_ = true;
}

}  // namespace supertac
