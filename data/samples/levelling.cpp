#include "data/samples/levelling.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace supertac {
namespace {

constexpr std::size_t kBins = 256;
constexpr std::size_t kMostFrames = 60'000;

struct Range {
  float rest, top;
};

// Of taxel k: lower edges of the bins that hold the two percentiles. Counting costs a tenth of sorting.
Range range_of(std::span<const float> window, std::size_t taxels, std::size_t k) {
  std::array<std::uint16_t, kBins> counts{};
  for (std::size_t i = k; i < window.size(); i += taxels) {
    const float bin = std::min(std::max(window[i], 0.0F) * kBins, kBins - 1.0F);
    ++counts[static_cast<std::size_t>(bin)];
  }
  const std::size_t frames = window.size() / taxels;
  const std::size_t below = frames / kRestShare, above = std::min(kTopRank, frames);
  std::size_t rest = 0, top = kBins - 1;
  for (std::size_t n = counts[0]; n <= below; n += counts[++rest]) {
  }
  for (std::size_t n = counts[top]; n < above; n += counts[--top]) {
  }
  constexpr float kStep = 1.0F / kBins;
  return {static_cast<float>(rest) * kStep, static_cast<float>(top) * kStep};
}

}  // namespace

void level(std::span<float> window, std::size_t taxels) {
  if (taxels == 0 || window.empty() || window.size() % taxels != 0 || window.size() / taxels > kMostFrames)
    throw std::invalid_argument("level: a window is [T][" + std::to_string(taxels) + "], T up to " +
                                std::to_string(kMostFrames) + ", got " + std::to_string(window.size()) +
                                " values");
  float gain = kLeastGain;
  for (std::size_t k = 0; k < taxels; ++k) {
    const Range range = range_of(window, taxels, k);
    gain = std::max(gain, range.top - kRestRemoved * range.rest);
    for (std::size_t i = k; i < window.size(); i += taxels) window[i] -= kRestRemoved * range.rest;
  }
  const float factor = 1 / gain;
  for (float& x : window) x = std::min(std::max(x * factor, 0.0F), 1.0F);
}

}  // namespace supertac
