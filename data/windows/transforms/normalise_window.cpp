#include "data/windows/transforms/normalise_window.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

namespace supertac {
namespace {

constexpr std::size_t kBins = 256;

struct Range {
  float rest, top;
};

// Lower edges of the bins that hold the two percentiles of one taxel.
Range range_of(std::span<const std::uint16_t, kBins> counts, std::size_t frames) {
  const std::size_t below = frames / kRestShare, above = std::min(kTopRank, frames);
  std::size_t rest = 0, top = kBins - 1;
  for (std::size_t n = counts[0]; n <= below; n += counts[++rest]) {
  }
  for (std::size_t n = counts[top]; n < above; n += counts[--top]) {
  }
  return {static_cast<float>(rest) / kBins, static_cast<float>(top) / kBins};
}

constexpr std::size_t kAtOnce = 16;

// NaN counts as 0. Of `count` taxels from `first` on. Counting costs a tenth of sorting; taking turns lets
// one count be written while the next is read.
std::array<Range, kAtOnce> ranges_of(std::span<const float> window, std::size_t taxels, std::size_t first,
                                     std::size_t count) {
  std::array<std::uint16_t, kAtOnce * kBins> counts{};
  for (std::size_t frame = first; frame < window.size(); frame += taxels) {
    std::array<std::int32_t, kAtOnce> bins;
    for (std::size_t k = 0; k < count; ++k)
      bins[k] = static_cast<std::int32_t>(std::min(std::max(0.0F, window[frame + k]) * kBins, kBins - 1.0F));
    for (std::size_t k = 0; k < count; ++k) ++counts[k * kBins + static_cast<std::size_t>(bins[k])];
  }
  std::array<Range, kAtOnce> ranges;
  for (std::size_t k = 0; k < count; ++k)
    ranges[k] = range_of(std::span(counts).subspan(k * kBins).first<kBins>(), window.size() / taxels);
  return ranges;
}

}  // namespace

void normalise_window(std::span<float> window, std::size_t taxels) {
  if (taxels == 0 || window.empty() || window.size() % taxels != 0 ||
      window.size() / taxels > std::numeric_limits<std::uint16_t>::max())
    throw std::invalid_argument("normalise_window: a window is [T][" + std::to_string(taxels) +
                                "], T up to " + std::to_string(std::numeric_limits<std::uint16_t>::max()) +
                                ", got " + std::to_string(window.size()) + " values");
  float gain = kLeastGain;
  for (std::size_t first = 0; first < taxels; first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, taxels - first);
    const std::array<Range, kAtOnce> ranges = ranges_of(window, taxels, first, count);
    for (std::size_t k = 0; k < count; ++k)
      gain = std::max(gain, ranges[k].top - kRestRemoved * ranges[k].rest);
    for (std::size_t frame = first; frame < window.size(); frame += taxels)
      for (std::size_t k = 0; k < count; ++k) window[frame + k] -= kRestRemoved * ranges[k].rest;
  }
  const float factor = 1 / gain;
  for (float& x : window) x = std::min(std::max(x * factor, 0.0F), 1.0F);
}

}  // namespace supertac
