// What the signals of a pass show by themselves, without its plate.
#include "data/registration/registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>

#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kBinS = 0.01;  // time resolution; dips last 0.2 s and more
constexpr std::size_t kMaxBins = 1'000'000;
constexpr double kMinDepthV = 0.008, kMinShare = 0.1;
constexpr double kFlatV = 1e-6;  // a saturated dip is flat up to rounding

// One taxel's signal as means over bins of kBinS, pressing upwards; empty bins are bridged by straight lines.
std::vector<double> binned(const Recording& recording, int taxel, std::size_t bins) {
  const auto channels = static_cast<std::size_t>(recording.array.channels);
  const SignalScale rig;
  std::vector<double> sum(bins), count(bins);
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    const float* const signals =
        recording.signals.data() + i * recording.array.signals() + static_cast<std::size_t>(taxel) * channels;
    double volts = 0;
    for (std::size_t c = 0; c < channels; ++c) volts += signals[c];
    volts /= static_cast<double>(channels);
    if (recording.signal_scale != rig) volts = recording.signal_scale.in(rig, volts);
    const auto bin = static_cast<std::size_t>((recording.time_s[i] - recording.time_s[0]) / kBinS);
    if (bin >= bins) continue;
    sum[bin] += rig::kAdcVolts - volts, count[bin] += 1;
  }
  std::vector<double> x(bins);
  std::ptrdiff_t last = -1;  // last bin that holds a sample
  for (std::size_t b = 0; b < bins; ++b) {
    if (count[b] == 0) continue;
    x[b] = sum[b] / count[b];
    const auto from = static_cast<std::size_t>(last + 1);
    for (std::size_t g = from; g < b; ++g) {
      const double part =
          last < 0 ? 1 : static_cast<double>(g - from + 1) / static_cast<double>(b - from + 1);
      x[g] = last < 0 ? x[b] : x[from - 1] + part * (x[b] - x[from - 1]);
    }
    last = static_cast<std::ptrdiff_t>(b);
  }
  for (std::size_t b = static_cast<std::size_t>(last + 1); last >= 0 && b < bins; ++b)
    x[b] = x[static_cast<std::size_t>(last)];
  return x;
}

// Where the signal falls to `level` when walking from `at` in direction `step` (bins, interpolated).
double crossing(const double* x, std::ptrdiff_t at, std::ptrdiff_t step, double level) {
  while (x[at] > level) at += step;
  const double outside = x[at], inside = x[at - step];
  return static_cast<double>(at) - static_cast<double>(step) * (level - outside) / (inside - outside);
}

// Lowest value met when walking away from a top until something higher, the reach, or the end of n bins.
double rim(const double* x, std::ptrdiff_t n, std::ptrdiff_t top, std::ptrdiff_t step, std::ptrdiff_t reach) {
  double lowest = x[top];
  for (std::ptrdiff_t at = top + step; std::abs(at - top) <= reach && at >= 0 && at < n; at += step) {
    if (x[at] > x[top] + kFlatV) break;
    lowest = std::min(lowest, x[at]);
  }
  return lowest;
}

void find_in(const std::vector<double>& bins, int taxel, double start_s, double reach_s,
             std::vector<Contact>& found) {
  const double* const x = bins.data();
  const auto n = static_cast<std::ptrdiff_t>(bins.size());
  const auto reach = static_cast<std::ptrdiff_t>(reach_s / kBinS);
  const auto first = static_cast<std::ptrdiff_t>(found.size());
  double deepest = 0;
  for (std::ptrdiff_t i = 1; i + 1 < n; ++i) {
    if (x[i] <= x[i - 1]) continue;
    std::ptrdiff_t j = i;  // a saturated top is a plateau i..j
    while (j + 1 < n && std::abs(x[j + 1] - x[i]) < kFlatV) ++j;
    if (j + 1 >= n || x[j + 1] > x[i]) continue;
    const double depth = x[i] - std::max(rim(x, n, i, -1, reach), rim(x, n, j, 1, reach));
    if (depth < kMinDepthV) continue;
    const double level = x[i] - depth / 2;
    const double left = crossing(x, i, -1, level), right = crossing(x, j, 1, level);
    deepest = std::max(deepest, depth);
    found.push_back(
        {.taxel = taxel, .time_s = start_s + ((left + right) / 2 + 0.5) * kBinS, .depth_v = depth});
    i = j;
  }
  const auto shallow = [&](const Contact& c) { return c.depth_v < kMinShare * deepest; };
  found.erase(std::remove_if(found.begin() + first, found.end(), shallow), found.end());
}

}  // namespace

std::vector<Contact> find_contacts(const Recording& recording, double reach_s) {
  const std::size_t n = recording.frames();
  std::vector<Contact> found;
  if (n < 3) return found;
  const double duration = recording.time_s.back() - recording.time_s.front();
  if (!(duration > 0) || duration / kBinS > static_cast<double>(kMaxBins))
    throw std::invalid_argument(refusal(
        "find_contacts", "time_s", "a span of more than 0 and at most " + format(kMaxBins * kBinS) + " s",
        format(duration) + " s"));
  const auto bins = static_cast<std::size_t>(duration / kBinS);
  for (int k = 0; k < recording.array.taxels(); ++k)
    find_in(binned(recording, k, bins), k, recording.time_s[0], reach_s, found);
  return found;
}

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
  const std::span<double> steps = std::span(found).first(to - from);
  if (steps.empty()) return {};
  for (std::size_t i = from; i < to; ++i) steps[i - from] = step_before(recording, i, s);
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
    for (std::size_t s = 0; s < signals; ++s)
      change[i] +=
          share * std::abs(recording.signals[i * signals + s] - recording.signals[(i - 1) * signals + s]);
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
