#include "data/registration/contacts.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "io/numbers/numbers.h"

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
    if (!std::isfinite(volts)) continue;
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
double crossing(const std::vector<double>& x, std::ptrdiff_t at, std::ptrdiff_t step, double level) {
  while (x[static_cast<std::size_t>(at)] > level) at += step;
  const double outside = x[static_cast<std::size_t>(at)], inside = x[static_cast<std::size_t>(at - step)];
  return static_cast<double>(at) - static_cast<double>(step) * (level - outside) / (inside - outside);
}

// Lowest value met when walking away from a top until something higher, the reach, or the end.
double rim(const std::vector<double>& x, std::ptrdiff_t top, std::ptrdiff_t step, std::ptrdiff_t reach) {
  const double height = x[static_cast<std::size_t>(top)];
  double lowest = height;
  for (std::ptrdiff_t n = 1, at = top + step;
       n <= reach && at >= 0 && at < static_cast<std::ptrdiff_t>(x.size()); ++n, at += step) {
    const double value = x[static_cast<std::size_t>(at)];
    if (value > height + kFlatV) break;
    lowest = std::min(lowest, value);
  }
  return lowest;
}

void find_in(const std::vector<double>& x, int taxel, double start_s, double reach_s,
             std::vector<Contact>& found) {
  const auto n = static_cast<std::ptrdiff_t>(x.size());
  const auto reach = static_cast<std::ptrdiff_t>(reach_s / kBinS);
  const std::size_t first = found.size();
  double deepest = 0;
  for (std::ptrdiff_t i = 1; i + 1 < n; ++i) {
    if (x[static_cast<std::size_t>(i)] <= x[static_cast<std::size_t>(i - 1)]) continue;
    std::ptrdiff_t j = i;  // a saturated top is a plateau i..j
    while (j + 1 < n &&
           std::abs(x[static_cast<std::size_t>(j + 1)] - x[static_cast<std::size_t>(i)]) < kFlatV)
      ++j;
    if (j + 1 >= n || x[static_cast<std::size_t>(j + 1)] > x[static_cast<std::size_t>(i)]) continue;
    const double depth = x[static_cast<std::size_t>(i)] - std::max(rim(x, i, -1, reach), rim(x, j, 1, reach));
    if (depth < kMinDepthV) continue;
    const double level = x[static_cast<std::size_t>(i)] - depth / 2;
    const double left = crossing(x, i, -1, level), right = crossing(x, j, 1, level);
    deepest = std::max(deepest, depth);
    found.push_back(
        {.taxel = taxel, .time_s = start_s + ((left + right) / 2 + 0.5) * kBinS, .depth_v = depth});
    i = j;
  }
  const auto shallow = [&](const Contact& c) { return c.depth_v < kMinShare * deepest; };
  found.erase(std::remove_if(found.begin() + static_cast<std::ptrdiff_t>(first), found.end(), shallow),
              found.end());
}

}  // namespace

std::vector<Contact> find_contacts(const Recording& recording, double reach_s) {
  const std::size_t n = recording.frames();
  const std::size_t signals = recording.array.signals();
  if (recording.signals.size() != n * signals)
    throw std::invalid_argument("find_contacts: " + std::to_string(n) + " frames need " +
                                std::to_string(n * signals) + " signals, got " +
                                std::to_string(recording.signals.size()));
  std::vector<Contact> found;
  if (n < 3) return found;
  const double duration = recording.time_s.back() - recording.time_s.front();
  if (!(duration > 0) || duration / kBinS > static_cast<double>(kMaxBins))
    throw std::invalid_argument("find_contacts: time stamps must increase and span at most " +
                                std::to_string(static_cast<int>(kMaxBins * kBinS)) + " s, got a span of " +
                                format(duration) + " s");
  const auto bins = static_cast<std::size_t>(duration / kBinS);
  for (int k = 0; k < recording.array.taxels(); ++k)
    find_in(binned(recording, k, bins), k, recording.time_s[0], reach_s, found);
  return found;
}

}  // namespace supertac
