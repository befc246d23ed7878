#include "hardware/boards/tactile_board.h"

#include <algorithm>
#include <array>

#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kReadSlice = 0.05;
constexpr std::size_t kReadBytes = 8192;  // twice what a terminal holds

}  // namespace

TactileBoard::TactileBoard(std::unique_ptr<Port> port, const BoardSettings& settings)
    : FrameQueue(settings.queue_frames, settings.wait_for_consumer),
      port_(std::move(port)),
      silence_s_(settings.silence_s),
      last_arrival_(port_->now()) {
  thread_ = std::thread([this] { run(); });
}

void TactileBoard::run() {
  try {
    while (!asked_to_stop()) read_once(port_->now() + kReadSlice);
    // What had arrived when the stop was asked for still counts. Where the machine is busy more comes with
    // every read: a port holds a tenth of a second at most.
    std::uint64_t before = 0;
    double now = port_->now();
    const double end = now + kReadSlice;
    do {
      before = decoder_.counters().bytes;
      read_once(now);
      if (decoder_.counters().bytes == before) break;
      now = port_->now();
    } while (now < end);
  } catch (...) {
    std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  numbering_.finish(places_);
  std::lock_guard lock(mutex_);
  keep_decided();
  end();
}

void TactileBoard::read_once(double until) {
  std::array<std::byte, kReadBytes> buffer{};
  const Received got = port_->read(buffer, until);
  const auto bytes = std::span(buffer).first(got.count);
  if (decoder_.counters().frames == 0) {
    for (const std::byte byte : bytes) text_bytes_ += is_text(byte) ? 1 : 0;
  }
  batch_.clear();
  decoder_.push(bytes, [&](const BoardFrame& frame, std::uint64_t discarded) {
    batch_.push_back({frame, discarded});
  });
  take_batch(got.time_s, got.count >= kTerminalFull);
  check_silence(got.time_s);
  std::lock_guard lock(mutex_);
  counters_.decoder = decoder_.counters();
}

void TactileBoard::check_silence(double time) {
  if (time - last_arrival_ < silence_s_) return;
  const std::uint64_t total = decoder_.counters().bytes;
  if (decoder_.counters().frames == 0 && total >= 2) {
    const bool text = text_bytes_ > 0.9 * static_cast<double>(total);
    throw WrongDevice("port " + port_->name() + ": expected a tactile board, found " +
                      (text
                           ? "text, as from a printer; exchange the two ports"
                           : std::to_string(total) +
                                 " bytes without a frame; choose the board's port (supertac-check machine)"));
  }
  throw BoardSilent("board " + port_->name() + ": expected " + format(rig::kFrameRateHz, 0) +
                    " frames/s, found none for " + format(silence_s_, 1) + " s; " +
                    (decoder_.counters().frames == 0
                         ? "is this the board's port (supertac-check machine)? If it is, "
                         : "") +
                    "plug the board out and in again");
}

void TactileBoard::take_batch(double time, bool more_waited) {
  steps_.clear();
  for (const Decoded& decoded : batch_) steps_.push_back(1 + damaged_frames(decoded.discarded));
  live_.date(time, more_waited, steps_, dates_);
  for (std::size_t i = 0; i < batch_.size(); ++i) {
    const FrameArrival arrival{time, steps_[i] - 1, more_waited};
    numbering_.push(arrival, places_);
    undecided_.push_back({time, i + 1 == batch_.size()});
    StampedFrame frame{.frame = batch_[i].frame, .arrival = arrival, .time_s = dates_[i]};
    frame.suspect = batch_[i].discarded > 0 || (!first_ && time - last_arrival_ > 1.5 * rig::kFramePeriodS);
    frame.jump = jumps_.jump(frame.frame);
    first_ = false;
    last_arrival_ = time;
    take(frame);
  }
}

void TactileBoard::take(StampedFrame frame) {
  std::unique_lock lock(mutex_);
  keep_decided();
  counters_.suspect += frame.suspect ? 1 : 0;
  counters_.jumps += frame.jump ? 1 : 0;
  put(lock, frame);
}

// With mutex_ held: the frames whose place is now certain go to the clock.
void TactileBoard::keep_decided() {
  for (const FramePlace& place : places_) {
    const Undecided frame = undecided_.front();
    undecided_.pop_front();
    if (frame.last && place.doubt == 0) clock_.add(static_cast<double>(place.index), frame.time_s);
  }
  places_.clear();
  counters_.missing = numbering_.missing();
}

BoardCounters TactileBoard::counters() {
  std::lock_guard lock(mutex_);
  BoardCounters counters = counters_;
  counters.dropped = dropped_;
  counters.clock = clock_.fit();
  return counters;
}

}  // namespace supertac
