#include "data/windows/transforms/augment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/numbers/hash.h"
#include "io/numbers/random.h"

namespace supertac {
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
  const auto check_one = [](const char* name, double value) {
    if (!(value >= 0) || !std::isfinite(value))
      throw std::invalid_argument(std::string("augmentation: ") + name +
                                  " must be 0 (off) or positive, got " + std::to_string(value));
  };
  check_one("lift", settings.lift);
  check_one("gain", settings.gain);
  check_one("taxel_gain", settings.taxel_gain);
  check_one("offset", settings.offset);
  check_one("noise", settings.noise);
  if (settings.dropped < 0 || settings.dropped > array.taxels())
    throw std::invalid_argument("augmentation: dropped must be 0 to " + std::to_string(array.taxels()) +
                                " taxels, got " + std::to_string(settings.dropped));
}

void augment(const AugmentSettings& settings, std::uint64_t seed, std::uint64_t sample,
             std::span<float> window, const TaxelArray& array) {
  const std::size_t signals = array.signals();
  if (window.size() % signals != 0)
    throw std::invalid_argument("augment: a window of " + array.text() + " is [T][" +
                                std::to_string(signals) + "], got " + std::to_string(window.size()) +
                                " values");
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
