#include "tests/hardware/virtual_rig/rig_world.h"

#include <algorithm>
#include <utility>

namespace supertac {
namespace {

constexpr int kStallFrames = 20;
constexpr int kHeldFrames = 25;  // in the tty of a host that does not read

}  // namespace

VirtualBoard::VirtualBoard(FingerSignals signals, const RigFaults& faults, std::uint64_t seed, double t)
    : signals_(std::move(signals)), faults_(faults), start_(t), dice_(seed, 202) {}

std::vector<std::byte> VirtualBoard::make_frame(const Point3& head) {
  const double middle = next_frame() - 0.5 * rig::kFramePeriodS;
  ++counters_.made;
  if (stalled_frames_ == 0 && dice_.hit(faults_.stall_rate)) stalled_frames_ = kStallFrames;
  if (stalled_frames_ == 0 && dice_.hit(faults_.freeze_rate)) {
    room_ = kHeldFrames - static_cast<int>(held_.size() / rig::kFrameBytes);
    stalled_frames_ = static_cast<int>((0.3 + 1.7 * dice_.uniform()) / rig::kFramePeriodS);
  }
  const bool stalled = stalled_frames_ > 0;
  const bool held = stalled && room_ > 0;
  if (held) --room_;
  if (stalled && --stalled_frames_ == 0) tear_next_ = true;
  const bool lost = (stalled && !held) || dice_.hit(faults_.lost_frame_rate);
  if (truth_) truth_(head);
  if (lost) {
    ++counters_.lost;
    return {};
  }
  TaxelVolts volts{};
  volts.fill(rig::kRestVolts);
  if (signals_) volts = signals_(head.x, head.y, head.z, middle);
  const BoardFrame fresh = frame_of(volts);
  BoardFrame frame = fresh;
  if (tear_next_) {  // half old, half new, behind a valid header and trailer
    std::copy_n(previous_.samples.begin(), rig::kFrameSamples / 2, frame.samples.begin());
    tear_next_ = false;
    ++counters_.torn;
  }
  previous_ = fresh;
  ++counters_.sent;
  std::vector<std::byte> bytes = std::exchange(held_, {});
  bytes.resize(bytes.size() + rig::kFrameBytes);
  write_frame(frame, std::span(bytes).last<rig::kFrameBytes>());
  if (held) std::swap(bytes, held_);
  return bytes;
}

void VirtualBoard::refuse_last() {
  --counters_.sent;
  ++counters_.lost;
  tear_next_ = true;
}

RigWorld::RigWorld(const RigSettings& settings, double t)
    : now_(t),
      printer_(settings.printer, t, settings.printer_running, settings.faults, settings.seed),
      board_(settings.signals, settings.faults, settings.seed, t),
      chunk_s_(settings.chunk_s),
      chunk_due_(t),
      memory_(settings.memory),
      chunk_dice_(settings.seed, 14),
      to_printer_bytes_(settings.faults.byte_rate, settings.seed, 11),
      from_printer_bytes_(settings.faults.byte_rate, settings.seed, 12),
      board_bytes_(settings.faults.byte_rate, settings.seed, 13) {}

double RigWorld::next_event() const {
  return std::min(
      {printer_.next_event(), board_.next_frame(), chunk_.empty() ? board_.next_frame() : chunk_due_});
}

void RigWorld::hand_on(double t) {
  const std::size_t taken = board_sink && !chunk_.empty() ? board_sink(chunk_, t) : chunk_.size();
  chunk_.erase(chunk_.begin(), chunk_.begin() + static_cast<std::ptrdiff_t>(taken));
  if (chunk_.size() > memory_) board_.refuse_last(), chunk_.resize(memory_);
  chunk_due_ = t + (chunk_.empty() ? 0.002 + (chunk_s_ - 0.002) * chunk_dice_.uniform() : 0.001);
}

void RigWorld::advance(double t) {
  while (board_.next_frame() <= t) {
    const double end = board_.next_frame();
    if (chunk_s_ > 0 && chunk_due_ < end) hand_on(chunk_due_);
    const double middle = std::max(now_, end - 0.5 * rig::kFramePeriodS);
    printer_.advance(middle);
    const Point3 head = printer_.head(middle);
    printer_.advance(end);
    now_ = end;
    const std::vector<std::byte> bytes = board_bytes_.apply(board_.make_frame(head));
    chunk_.insert(chunk_.end(), bytes.begin(), bytes.end());
    if (chunk_s_ <= 0) hand_on(end);
  }
  if (chunk_s_ > 0 && chunk_due_ <= t) hand_on(chunk_due_);
  printer_.advance(t);
  now_ = std::max(now_, t);
}

void RigWorld::to_printer(std::span<const std::byte> bytes) {
  const std::vector<std::byte> damaged = to_printer_bytes_.apply(bytes);
  printer_.receive({reinterpret_cast<const char*>(damaged.data()), damaged.size()}, now_);
}

std::vector<std::byte> RigWorld::from_printer() {
  const std::string text = printer_.take_output();
  return from_printer_bytes_.apply(std::as_bytes(std::span(text)));
}

}  // namespace supertac
