#include "data/recordings/signal_range.h"

#include <algorithm>
#include <cmath>

#include "io/numbers.h"

namespace supertac {
namespace {

constexpr std::size_t kFramesApart = 64;
constexpr double kTail = 0.005, kMostClipped = 0.05, kLeastFilled = 0.1, kMargin = 1.1;
// The rest of some taxels lies above the common one.
constexpr double kAboveRest = 0.25;

}  // namespace

SignalRange SignalRange::of_folder(const std::string& dir, const std::vector<std::string>& plates) {
  SignalRange range;
  for (const std::string& path : list_recordings(dir)) {
    const Recording recording = read_recording(path);
    if (plates.empty() || std::ranges::find(plates, recording.plate) != plates.end()) range.add(recording);
  }
  return range;
}

void SignalRange::add(const Recording& recording) {
  const std::size_t signals = recording.array.signals();
  const auto before = static_cast<std::ptrdiff_t>(sorted_.size());
  for (std::size_t i = 0; i < recording.volts.size(); i += kFramesApart * signals)
    for (std::size_t k = 0; k < signals; ++k)
      if (std::isfinite(recording.volts[i + k])) sorted_.push_back(recording.volts[i + k]);
  std::sort(sorted_.begin() + before, sorted_.end());
  std::inplace_merge(sorted_.begin(), sorted_.begin() + before, sorted_.end());
}

double SignalRange::clipped(const Scaling& s) const {
  if (sorted_.empty()) return 0;
  const auto pressed = std::ranges::lower_bound(sorted_, s.rest_volts - s.span_volts) - sorted_.begin();
  const auto above =
      sorted_.end() - std::ranges::upper_bound(sorted_, s.rest_volts + kAboveRest * s.span_volts);
  return static_cast<double>(pressed + above) / static_cast<double>(sorted_.size());
}

double SignalRange::level(double share) const {
  return double{sorted_[static_cast<std::size_t>(share * static_cast<double>(sorted_.size() - 1))]};
}

Scaling SignalRange::fitted() const {
  const Scaling rig;
  if (sorted_.empty()) return rig;
  const double low = level(kTail), high = level(1 - kTail);
  if (clipped(rig) <= kMostClipped && high - low >= kLeastFilled * rig.span_volts) return rig;
  return {.rest_volts = high, .span_volts = std::max(kMargin * (high - low), 1e-6)};
}

std::string SignalRange::text() const {
  return sorted_.empty() ? "nowhere" : format(level(kTail), 3) + " to " + format(level(1 - kTail), 3);
}

}  // namespace supertac
