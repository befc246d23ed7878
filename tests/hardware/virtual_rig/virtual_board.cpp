#include "tests/hardware/virtual_rig/virtual_board.h"

#include <algorithm>
#include <utility>

namespace supertac {
namespace {

constexpr int kStallFrames = 20;
constexpr int kHeldFrames = 25;  // in the tty of a host that does not read

}  // namespace

VirtualBoard::VirtualBoard(const VirtualBoardSettings& settings, double t)
    : settings_(settings), start_(t), dice_(settings.seed, 202) {}

BoardFrame VirtualBoard::sample(const Point3& head, double t) {
  TaxelVolts volts{};
  volts.fill(rig::kRestVolts);
  if (settings_.signals) volts = settings_.signals(head.x, head.y, head.z, t);
  return frame_of(volts);
}

std::vector<std::byte> VirtualBoard::make_frame(const Point3& head) {
  const double middle = next_frame() - 0.5 * settings_.period_s;
  ++counters_.made;
  if (stalled_frames_ == 0 && dice_.hit(settings_.faults.stall_rate)) stalled_frames_ = kStallFrames;
  if (stalled_frames_ == 0 && dice_.hit(settings_.faults.freeze_rate)) {
    room_ = kHeldFrames - static_cast<int>(held_.size() / rig::kFrameBytes);
    stalled_frames_ = static_cast<int>((0.3 + 1.7 * dice_.uniform()) / settings_.period_s);
  }
  const bool stalled = stalled_frames_ > 0;
  const bool held = stalled && room_ > 0;
  if (held) --room_;
  if (stalled && --stalled_frames_ == 0) tear_next_ = true;
  const bool lost = (stalled && !held) || dice_.hit(settings_.faults.lost_frame_rate);
  if (truth_) truth_(head);
  if (lost) {
    ++counters_.lost;
    return {};
  }
  const BoardFrame fresh = sample(head, middle);
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

}  // namespace supertac
