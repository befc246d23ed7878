#include "data/windows/transforms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kBins = 256;

struct Range {
  float rest, top;
};

// Lower edges of the bins that hold rest and top of one signal.
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

// Of `count` signals from `first` on, NaN counting as 0. Counting costs a tenth of sorting; taking turns lets
// one count be written while the next is read.
std::array<Range, kAtOnce> ranges_of(std::span<const float> window, std::size_t signals, std::size_t first,
                                     std::size_t count) {
  std::array<std::uint16_t, kAtOnce * kBins> counts{};
  for (std::size_t frame = first; frame < window.size(); frame += signals) {
    std::array<std::int32_t, kAtOnce> bins;
    for (std::size_t k = 0; k < count; ++k)
      bins[k] = static_cast<std::int32_t>(std::min(std::max(0.0F, window[frame + k]) * kBins, kBins - 1.0F));
    for (std::size_t k = 0; k < count; ++k) ++counts[k * kBins + static_cast<std::size_t>(bins[k])];
  }
  std::array<Range, kAtOnce> ranges;
  for (std::size_t k = 0; k < count; ++k)
    ranges[k] = range_of(std::span(counts).subspan(k * kBins).first<kBins>(), window.size() / signals);
  return ranges;
}

}  // namespace

void normalise_window(std::span<float> window, std::size_t signals) {
  if (signals == 0 || window.empty() || window.size() % signals != 0 ||
      window.size() / signals > std::numeric_limits<std::uint16_t>::max())
    throw std::invalid_argument(refusal("normalise_window", "window",
                                        "[T][" + std::to_string(signals) + "] with T from 1 to 65535",
                                        std::to_string(window.size()) + " values"));
  float gain = kLeastGain;
  for (std::size_t first = 0; first < signals; first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, signals - first);
    const std::array<Range, kAtOnce> ranges = ranges_of(window, signals, first, count);
    for (std::size_t k = 0; k < count; ++k)
      gain = std::max(gain, ranges[k].top - kRestRemoved * ranges[k].rest);
    for (std::size_t frame = first; frame < window.size(); frame += signals)
      for (std::size_t k = 0; k < count; ++k) window[frame + k] -= kRestRemoved * ranges[k].rest;
  }
  const float factor = 1 / gain;
  for (float& x : window) x = std::min(std::max(x * factor, 0.0F), 1.0F);
}

namespace {

// Counters within one sample's stream: each term has its own, as many as there are signals.
enum Term : std::uint64_t { kGain, kTaxelGain, kOffset, kDropCount, kDropChoice, kNoiseKey, kLift };

double factor(double magnitude, double uniform) {
  const double v = 2 * uniform - 1;
  return v >= 0 ? 1 + magnitude * v : 1 / (1 - magnitude * v);
}

// Sum of the four 16-bit numbers in `bits`, mean 0, variance 1.
float rough_normal(std::uint64_t bits) {
  const auto sum = static_cast<std::int32_t>((bits & 0xffff) + ((bits >> 16) & 0xffff) +
                                             ((bits >> 32) & 0xffff) + (bits >> 48));
  constexpr float kMean = 2 * 65535.0F;
  constexpr float kPerUnit = 1 / 37837.227F;  // 65536 sqrt(4 / 12)
  return (static_cast<float>(sum) - kMean) * kPerUnit;
}

// Which taxels are dropped, of all: the first `count` of a random order.
void choose_dropped(int at_most, const TaxelArray& array, const RandomStream& random,
                    std::vector<char>& dropped) {
  thread_local std::vector<std::size_t> order;
  const std::uint64_t signals = array.signals();
  const int count = static_cast<int>(random.uniform(kDropCount * signals) * (at_most + 1));
  const auto taxels = static_cast<std::size_t>(array.taxels());
  dropped.assign(taxels, false), order.resize(taxels);
  for (std::size_t k = 0; k < taxels; ++k) order[k] = k;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const auto left = static_cast<double>(taxels - i);
    std::swap(order[i],
              order[i + static_cast<std::size_t>(random.uniform(kDropChoice * signals + i) * left)]);
    dropped[order[i]] = true;
  }
}

}  // namespace

void check(const AugmentSettings& settings, const TaxelArray& array) {
  for (const auto& [name, value] : {std::pair("lift", settings.lift),
                                    {"gain", settings.gain},
                                    {"taxel_gain", settings.taxel_gain},
                                    {"offset", settings.offset},
                                    {"noise", settings.noise}})
    if (!(value >= 0) || !std::isfinite(value))
      throw std::invalid_argument(refusal("augmentation", name, "0 (off) or more", format(value)));
  if (settings.dropped < 0 || settings.dropped > array.taxels())
    throw std::invalid_argument(refusal("augmentation", "dropped", "0 to " + std::to_string(array.taxels()),
                                        std::to_string(settings.dropped)));
}

void augment(const AugmentSettings& settings, std::uint64_t seed, std::uint64_t sample,
             std::span<float> window, const TaxelArray& array) {
  const std::size_t signals = array.signals();
  if (window.size() % signals != 0)
    throw std::invalid_argument(refusal("augment", "window",
                                        "[T][" + std::to_string(signals) + "] of " + array.text(),
                                        std::to_string(window.size()) + " values"));
  if (!settings.any()) return;
  check(settings, array);
  const RandomStream random(seed, stream_named("aug") << 40 ^ sample);  // clear of the streams of others
  const auto lift = static_cast<float>(settings.lift * random.uniform(kLift * signals));
  const double window_gain = factor(settings.gain, random.uniform(kGain));
  // Too large for the stack of a small thread, and not to be taken anew for every window.
  thread_local std::vector<float> gain, offset, top;
  thread_local std::vector<char> dropped;
  choose_dropped(settings.dropped, array, random, dropped);
  for (std::vector<float>* values : {&gain, &offset, &top}) values->resize(signals);
  for (std::size_t k = 0; k < signals; ++k) {
    const double own = factor(settings.taxel_gain, random.uniform(kTaxelGain * signals + k));
    gain[k] = static_cast<float>(window_gain * own);
    offset[k] = static_cast<float>(settings.offset * (2 * random.uniform(kOffset * signals + k) - 1));
    top[k] = dropped[k / static_cast<std::size_t>(array.channels)] ? 0.0F : 1.0F;  // dropped: an empty range
  }
  const std::uint64_t noise_key = kNoiseKey * signals;
  const std::uint64_t key = (std::uint64_t{random.bits(noise_key)} << 32) | random.bits(noise_key + 1);
  const auto noise = static_cast<float>(settings.noise);
  for (std::size_t t = 0; t < window.size() / signals; ++t) {
    float* x = &window[t * signals];
    for (std::size_t k = 0; k < signals; ++k) {
      float value = gain[k] * std::max(x[k] - lift, 0.0F) + offset[k];
      if (noise > 0) value += noise * rough_normal(mix64(key + (t * signals + k) * kGolden64));
      x[k] = std::min(std::max(value, 0.0F), top[k]);
    }
  }
}

}  // namespace supertac
