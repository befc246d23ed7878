#include "data/registration/lost_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::size_t kAround = 40;      // steps to either side that say what is usual, ...
constexpr std::size_t kEvery = 8;        // ... asked so often: it changes slowly
constexpr double kRoundingVolts = 1e-5;  // of a step in a text file
constexpr double kLeastSteps = 1.5, kUncertainties = 3;
constexpr double kSeenUncertainty = 0.25;
constexpr double kBurstVolts = 0.08, kBurstRatio = 60, kQuietVolts = 1e-4;

// Of one signal.
double step_before(const Recording& recording, std::size_t i, std::size_t s) {
  const std::size_t n = recording.array.signals();
  return static_cast<double>(recording.signals[i * n + s]) -
         static_cast<double>(recording.signals[(i - 1) * n + s]);
}

struct Usual {
  double step = 0, deviation = std::numeric_limits<double>::infinity();
};

Usual usual_step(const Recording& recording, std::size_t around, std::size_t s) {
  const std::size_t from = around > kAround ? around - kAround : 1;
  const std::size_t to = std::min(around + kAround + 1, recording.frames());
  std::array<double, 2 * kAround + 1> found{};
  std::size_t n = 0;
  for (std::size_t i = from; i < to; ++i)
    if (const double d = step_before(recording, i, s); std::isfinite(d)) found[n++] = d;
  if (n == 0) return {};
  const std::span<double> steps = std::span(found).first(n);
  const double step = median(steps);
  for (double& d : steps) d = std::abs(d - step);
  return {.step = step, .deviation = normal_deviation(steps) + kRoundingVolts};
}

// How many usual steps all signals took at once.
struct Steps {
  double count = 1, uncertainty = std::numeric_limits<double>::infinity();
};

Steps steps_before(const Recording& recording, std::size_t i, std::span<const Usual> usual) {
  double agreement = 0, information = 0;
  for (std::size_t s = 0; s < usual.size(); ++s) {
    const double d = step_before(recording, i, s);
    if (!std::isfinite(d)) continue;
    const double weight = 1 / (usual[s].deviation * usual[s].deviation);
    agreement += weight * d * usual[s].step;
    information += weight * usual[s].step * usual[s].step;
  }
  if (!(information > 0)) return {};
  return {.count = agreement / information, .uncertainty = 1 / std::sqrt(information)};
}

// Sum of the signals' changes before each frame, as that of the rig's sixteen taxels in volts that say the
// same.
std::vector<double> changes(const Recording& recording) {
  const std::size_t signals = recording.array.signals();
  const double share = std::abs(SignalScale{}.span / recording.signal_scale.span) *
                       static_cast<double>(rig::kTaxels) / static_cast<double>(signals);  // of the rig: 1
  std::vector<double> change(recording.frames());
  for (std::size_t i = 1; i < change.size(); ++i)
    for (std::size_t s = 0; s < signals; ++s) {
      const double step =
          std::abs(recording.signals[i * signals + s] - recording.signals[(i - 1) * signals + s]);
      if (std::isfinite(step)) change[i] += share * step;
    }
  return change;
}

}  // namespace

std::vector<double> find_lost_frames(const Recording& recording, double rate_hz) {
  std::vector<double> lost(recording.frames());
  std::vector<Usual> usual(recording.array.signals());
  double sum = 0, seen = 0;
  for (std::size_t i = 1; i < recording.frames(); ++i) {
    if (i % kEvery == 1)
      for (std::size_t s = 0; s < usual.size(); ++s)
        usual[s] = usual_step(recording, std::min(i + kEvery / 2, recording.frames() - 1), s);
    const Steps steps = steps_before(recording, i, usual);
    lost[i] = NAN;
    if (steps.uncertainty > kSeenUncertainty) continue;
    const double known = std::round((recording.time_s[i] - recording.time_s[i - 1]) * rate_hz);
    const bool jumped = steps.count > kLeastSteps + kUncertainties * steps.uncertainty;
    lost[i] = jumped ? std::max(0.0, std::round(steps.count) - known) : 0;
    sum += lost[i], ++seen;
  }
  const double mean = seen > 0 ? sum / seen : 0;
  std::ranges::replace_if(
      lost, [](double v) { return std::isnan(v); }, mean);
  return lost;
}

void restore_clock(Recording& recording, double rate_hz) {
  std::vector<double> lost = find_lost_frames(recording, rate_hz);
  std::partial_sum(lost.begin(), lost.end(), lost.begin());
  for (std::size_t i = 0; i < recording.frames(); ++i) recording.time_s[i] += lost[i] / rate_hz;
  recording.metadata["lost_frames"] = format(lost.empty() ? 0 : lost.back(), 0);
}

std::vector<Stretch> stretches_of(const Recording& recording) {
  const std::vector<double> change = changes(recording);
  std::vector<double> sum(change.size() + 1);
  for (std::size_t i = 0; i < change.size(); ++i) sum[i + 1] = sum[i] + change[i];
  std::vector<Stretch> parts = {{.begin_s = recording.time_s.front()}};
  for (std::size_t i = 1; i < change.size(); ++i) {
    if (change[i] < kBurstVolts) continue;
    const std::size_t from = i > kAround ? i - kAround : 0;
    const std::size_t to = std::min(i + kAround + 1, change.size());
    const double usual = (sum[to] - sum[from] - change[i]) / static_cast<double>(to - from - 1);
    if (change[i] < kBurstRatio * (usual + kQuietVolts)) continue;
    parts.back().end_s = recording.time_s[i - 1];
    parts.push_back({.begin_s = recording.time_s[i]});
  }
  parts.back().end_s = recording.time_s.back();
  return parts;
}

}  // namespace supertac
