#include "data/recordings/signal_range.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kTail = 0.005;

}  // namespace

std::string contradiction(std::span<const float> signals, const SignalScale& scale) {
  if (signals.empty()) return {};
  const double low = scale.low(), high = scale.high(), margin = 0.25 * (high - low);
  const auto outside =
      std::ranges::count_if(signals, [&](double v) { return v < low - margin || v > high + margin; });
  const auto [least, most] = std::ranges::minmax(signals);
  const auto whole = [](float v) { return v == std::round(v); };
  // At rest a sensor of counts may stay at 0 and 1 as well.
  const bool shares = least >= -0.01 && most <= 1.01 && most - least > 0.5F && high - low >= 10 &&
                      !std::ranges::all_of(signals, whole);
  if (static_cast<double>(outside) <= 0.5 * static_cast<double>(signals.size()) && !shares) return {};
  return "from " + format(least) + " to " + format(most) + ", the sensor's range is " + format(low) + " to " +
         format(high) + " " + scale.unit;
}

SignalRange SignalRange::of_folder(const std::string& dir, const std::vector<std::string>& plates,
                                   const ReadingWatch& watch, bool any_signals) {
  SignalRange range;
  const std::vector<std::string> paths = list_recordings(dir);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (watch) watch(i, paths.size());
    const Recording recording = read_recording(paths[i]);
    if (!plates.empty() && std::ranges::find(plates, recording.plate) == plates.end()) continue;
    // Older ones state none: theirs is the rig's.
    if (!any_signals && recording.signal_scale != SignalScale{})
      if (const std::string why = contradiction(recording.signals, recording.signal_scale); !why.empty())
        throw FileError(
            paths[i], "has signals " + why + "; import it anew with the file of its sensor, or give --range");
    range.add(recording);
  }
  return range;
}

void SignalRange::add(const Recording& recording) {
  felt_.add(recording);
  if (values_.empty()) stated_ = {.rest = recording.signal_scale.rest, .span = recording.signal_scale.span};
  const std::size_t signals = recording.array.signals(), frames = recording.frames();
  const std::size_t apart = factor_ * std::clamp(frames / 16, std::size_t{1}, std::size_t{64});
  for (; next_ < frames; next_ += apart)
    for (std::size_t k = 0; k < signals; ++k) {
      const float value = recording.signals[next_ * signals + k];
      if (std::isfinite(value)) values_.push_back(value);
    }
  sorted_ = false;
  next_ = factor_ > 1 ? next_ - frames : 0;
  while (values_.size() > (1 << 22)) thin_out();
}

// Every second of the sorted values: the levels stay where they are.
void SignalRange::thin_out() {
  values();
  for (std::size_t i = 0; 2 * i < values_.size(); ++i) values_[i] = values_[2 * i];
  values_.resize((values_.size() + 1) / 2);
  factor_ *= 2;
}

const std::vector<float>& SignalRange::values() const {
  if (!sorted_) std::sort(values_.begin(), values_.end());
  sorted_ = true;
  return values_;
}

double SignalRange::clipped(const Scaling& s) const {
  if (values_.empty()) return 0;
  const std::vector<float>& sorted = values();
  const double pressed = s.rest - s.span, beyond_rest = s.rest + 0.25 * s.span;
  const auto below = std::ranges::lower_bound(sorted, std::min(pressed, beyond_rest)) - sorted.begin();
  const auto above = sorted.end() - std::ranges::upper_bound(sorted, std::max(pressed, beyond_rest));
  return static_cast<double>(below + above) / static_cast<double>(sorted.size());
}

double SignalRange::level(double share) const {
  return double{values()[static_cast<std::size_t>(share * static_cast<double>(values_.size() - 1))]};
}

Scaling SignalRange::fitted() const {
  if (values_.empty()) return stated_;
  const double low = level(kTail), high = level(1 - kTail);
  if (clipped(stated_) <= 0.05 && high - low >= 0.1 * std::abs(stated_.span)) return stated_;
  const double span = std::max(1.1 * (high - low), 1e-6);
  if (stated_.span < 0) return {.rest = low, .span = -span};
  return {.rest = high, .span = span};
}

std::string SignalRange::text() const {
  return values_.empty() ? "nowhere" : format(level(kTail), 3) + " to " + format(level(1 - kTail), 3);
}

void FeltTaxels::add(const Recording& recording) {
  if (recording.source != "simulated" || recording.frames() == 0) return;
  const std::size_t signals = recording.array.signals();
  if (low_.empty()) {
    array_ = recording.array, span_ = std::abs(recording.signal_scale.span);
    flat_ = recording.body.value_or(Body::usual(array_)).shape == BodyShape::flat;
    low_.assign(recording.signals.begin(), recording.signals.begin() + static_cast<std::ptrdiff_t>(signals));
    high_ = low_;
  }
  if (recording.array != array_) return;
  for (std::size_t i = 0; i < recording.signals.size(); ++i) {
    low_[i % signals] = std::min(low_[i % signals], recording.signals[i]);
    high_[i % signals] = std::max(high_[i % signals], recording.signals[i]);
  }
}

std::vector<int> FeltTaxels::unfelt() const {
  std::vector<int> taxels;
  const auto channels = static_cast<std::size_t>(array_.channels);
  for (std::size_t k = 0; k < low_.size() / channels; ++k) {
    float most = 0;
    for (std::size_t s = k * channels; s < (k + 1) * channels; ++s) most = std::max(most, high_[s] - low_[s]);
    if (most < 0.1F * static_cast<float>(span_)) taxels.push_back(static_cast<int>(k));
  }
  return taxels;
}

std::string FeltTaxels::complaint() const {
  const std::vector<int> taxels = unfelt();
  if (4 * taxels.size() <= 3 * static_cast<std::size_t>(array_.taxels())) return "";
  std::vector<std::string> runs;
  for (std::size_t i = 0, end = 0; i < taxels.size(); i = end) {
    for (end = i + 1; end < taxels.size() && taxels[end] == taxels[end - 1] + 1;) ++end;
    runs.push_back(std::to_string(taxels[i]) + (end - i > 1 ? "-" + std::to_string(taxels[end - 1]) : ""));
  }
  return std::to_string(taxels.size()) + " of " + std::to_string(array_.taxels()) +
         (taxels.size() == 1 ? " taxels feels nothing: " : " taxels feel nothing: ") + joined(runs, ", ") +
         "; a network would learn that they never do. " +
         (flat_ ? "Simulate presses (supertac-simulate --presses N), which reach every taxel"
                : "Say in the sensor's file what shape the array has, \"body\": {\"shape\": \"flat\"}, and "
                  "simulate again");
}

void FeltTaxels::check() const {
  if (const std::string found = complaint(); !found.empty()) throw std::runtime_error(found);
}

}  // namespace supertac
