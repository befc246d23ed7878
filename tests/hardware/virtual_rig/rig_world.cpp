#include "tests/hardware/virtual_rig/rig_world.h"

#include <algorithm>
#include <utility>

namespace supertac {
namespace {

/// Settings of the printer or the board, with the rig's faults and seed.
template <class Part>
Part part_of(const RigSettings& settings, Part part) {
  part.faults = settings.faults;
  part.seed = settings.seed;
  return part;
}

}  // namespace

RigWorld::RigWorld(const RigSettings& settings, double t)
    : now_(t),
      printer_(part_of(settings, settings.printer), t, settings.printer_running),
      board_(part_of(settings, settings.board), t),
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
    const double middle = std::max(now_, end - 0.5 * board_.period());
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
