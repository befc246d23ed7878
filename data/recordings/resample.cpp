#include "data/recordings/resample.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kTail = 0.005;

// Where the finger was at `at`, between the recorded frame `before` and the next of a run that stops at
// `end`.
void append_position(const Recording& recording, double at, std::size_t before, std::size_t end,
                     Track& track) {
  const std::vector<double>& time = recording.time_s;
  const std::size_t after = std::min(before + 1, end - 1);
  track.recorded.push_back(static_cast<std::uint32_t>(time[after] - at < at - time[before] ? after : before));
  if (recording.position_mm.empty()) {
    track.position_mm.insert(track.position_mm.end(), 2, NAN);
    track.lift_mm.push_back(0);
    return;
  }
  const double span = time[after] - time[before];
  const double part = span > 0 ? std::clamp((at - time[before]) / span, 0.0, 1.0) : 0.0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double a = recording.position_mm[2 * before + axis], b = recording.position_mm[2 * after + axis];
    track.position_mm.push_back(static_cast<float>(part > 0 ? a + part * (b - a) : a));
  }
  const std::vector<float>& lift = recording.lift_mm;
  track.lift_mm.push_back(lift.empty() ? 0 : std::lerp(lift[before], lift[after], static_cast<float>(part)));
}

// The recorded frames [first, end), which no gap interrupts.
void append_run(const Recording& recording, const ResampleSettings& settings, std::size_t first,
                std::size_t end, Track& track) {
  const std::vector<double>& time = recording.time_s;
  const std::size_t samples = sample_at(time[end - 1] - time[first], settings.rate_hz) + 1;
  // A file that claims a high rate must not decide how much memory that takes.
  constexpr std::size_t kMostPerFrame = 64;
  if (samples > kMostPerFrame * (end - first + 1))
    throw std::invalid_argument(
        refusal("resample", "rate_hz",
                "at most " + std::to_string(kMostPerFrame) + " samples for each recorded frame",
                format(settings.rate_hz) + " Hz; the model is of another sensor"));
  const std::size_t signals = recording.array.signals(), begin = track.samples.size();
  track.samples.resize(begin + samples * signals);
  track.held += samples;
  Resampler resampler(signals, settings.rate_hz, settings.scaling);
  for (std::size_t i = first; i < end; ++i) {
    const std::size_t had = resampler.samples();
    resampler.add(time[i], std::span(recording.signals).subspan(i * signals, signals),
                  [&](std::size_t j, std::span<const float> sample) {
                    std::ranges::copy(
                        sample, track.samples.begin() + static_cast<std::ptrdiff_t>(begin + j * signals));
                  });
    if (resampler.samples() > had) --track.held;
  }
  for (std::size_t j = 0, before = first; j < samples; ++j) {
    const double at = time[first] + static_cast<double>(j) / settings.rate_hz;
    while (before + 1 < end && time[before + 1] <= at) ++before;
    append_position(recording, at, before, end, track);
    track.run.push_back(static_cast<std::uint32_t>(j + 1));
  }
}

}  // namespace

float Scaling::operator()(float signals) const {
  return static_cast<float>(std::min(std::max((rest - signals) / span, 0.0), 1.0));
}

void Scaling::operator()(std::span<float> signals) const {
  for (float& v : signals) v = (*this)(v);
}

void FrameMean::clear() {
  std::fill(sum_.begin(), sum_.end(), 0.0);
  count_ = 0;
}

void FrameMean::add(std::span<const float> signals) {
  for (std::size_t k = 0; k < sum_.size(); ++k) sum_[k] += signals[k];
  ++count_;
}

void FrameMean::write(std::span<float> mean) const {
  for (std::size_t k = 0; k < sum_.size(); ++k)
    mean[k] = static_cast<float>(sum_[k] / static_cast<double>(count_));
}

std::size_t sample_at(double since_begin_s, double rate_hz) {
  return static_cast<std::size_t>(std::max(0.0, std::ceil(since_begin_s * rate_hz - 0.5 - kCellSlack)));
}

Track resample(const Recording& recording, const ResampleSettings& settings) {
  if (const auto problem = problem_of(recording))
    throw std::runtime_error("recording: " + *problem + "; record or import the pass again");
  Track track;
  const std::vector<double>& time = recording.time_s;
  const double most_s = longest_silence_s(recording.period_s());
  for (std::size_t first = 0, end = 0; first < time.size(); first = end) {
    for (end = first + 1; end < time.size() && !settings.frames_apart && time[end] - time[end - 1] <= most_s;)
      ++end;
    append_run(recording, settings, first, end, track);
    if (end < time.size()) ++track.gaps;
  }
  return track;
}

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
    for (std::size_t k = 0; k < signals; ++k) values_.push_back(recording.signals[next_ * signals + k]);
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

}  // namespace supertac
