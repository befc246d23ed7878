#include "data/augment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "data/hash.h"
#include "data/recording.h"
#include "io/random.h"

namespace supertac {
namespace {

// Counters within one sample's stream; each term has its own.
constexpr uint64_t kGain = 0, kTaxelGain = 16, kOffset = 32, kDropCount = 48, kDropChoice = 64,
                   kNoiseKey = 80;
constexpr uint64_t kAugmentStream = 0x617567ULL << 40;  // keeps clear of the streams other code uses

double factor(double magnitude, double uniform) {
  const double v = 2 * uniform - 1;
  return v >= 0 ? 1 + magnitude * v : 1 / (1 - magnitude * v);
}

// Sum of the four 16-bit numbers in `bits`, mean 0, variance 1.
float rough_normal(uint64_t bits) {
  const auto sum = static_cast<int32_t>((bits & 0xffff) + ((bits >> 16) & 0xffff) + ((bits >> 32) & 0xffff) +
                                        (bits >> 48));
  constexpr float kMean = 2 * 65535.0F;
  constexpr float kPerUnit = 1 / 37837.227F;  // 65536 sqrt(4 / 12)
  return (static_cast<float>(sum) - kMean) * kPerUnit;
}

// Which taxels are dropped: the first `count` of a random order.
std::array<bool, kTaxels> choose_dropped(int at_most, const RandomStream& random) {
  std::array<bool, kTaxels> dropped{};
  const int count = static_cast<int>(random.uniform(kDropCount) * (at_most + 1));
  std::array<size_t, kTaxels> order;
  for (size_t k = 0; k < kTaxels; ++k) order[k] = k;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const auto left = static_cast<double>(kTaxels - i);
    std::swap(order[i], order[i + static_cast<size_t>(random.uniform(kDropChoice + i) * left)]);
    dropped[order[i]] = true;
  }
  return dropped;
}

}  // namespace

void check(const AugmentSettings& settings) {
  const auto check_one = [](const char* name, double value) {
    if (!(value >= 0) || !std::isfinite(value))
      throw std::invalid_argument(std::string("augmentation: ") + name +
                                  " must be 0 (off) or positive, got " + std::to_string(value));
  };
  check_one("gain", settings.gain);
  check_one("taxel_gain", settings.taxel_gain);
  check_one("offset", settings.offset);
  check_one("noise", settings.noise);
  if (settings.dropped < 0 || settings.dropped > kTaxels)
    throw std::invalid_argument("augmentation: dropped must be 0 to 16 taxels, got " +
                                std::to_string(settings.dropped));
}

void augment(const AugmentSettings& settings, uint64_t seed, uint64_t sample, std::span<float> window) {
  if (window.size() % kTaxels != 0)
    throw std::invalid_argument("augment: a window is [T][16], got " + std::to_string(window.size()) +
                                " values");
  if (!settings.any()) return;
  check(settings);
  const RandomStream random(seed, kAugmentStream ^ sample);
  const std::array<bool, kTaxels> dropped = choose_dropped(settings.dropped, random);
  const double window_gain = factor(settings.gain, random.uniform(kGain));
  std::array<float, kTaxels> gain, offset, noise, top;
  for (size_t k = 0; k < kTaxels; ++k) {
    gain[k] = static_cast<float>(window_gain * factor(settings.taxel_gain, random.uniform(kTaxelGain + k)));
    offset[k] = static_cast<float>(settings.offset * (2 * random.uniform(kOffset + k) - 1));
    noise[k] = static_cast<float>(settings.noise);
    top[k] = dropped[k] ? 0.0F : 1.0F;  // a dropped taxel is one whose range is empty
  }
  const uint64_t key = (uint64_t{random.bits(kNoiseKey)} << 32) | random.bits(kNoiseKey + 1);
  const bool noisy = settings.noise > 0;
  for (size_t t = 0; t < window.size() / kTaxels; ++t) {
    float* x = &window[t * kTaxels];
    for (size_t k = 0; k < kTaxels; ++k) {
      float value = gain[k] * x[k] + offset[k];
      if (noisy) value += noise[k] * rough_normal(mix64(key + (t * kTaxels + k) * kGolden64));
      x[k] = std::min(std::max(value, 0.0F), top[k]);
    }
  }
}

}  // namespace supertac
