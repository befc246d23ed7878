#include "data/windows/contact_level.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "io/numbers/median.h"

namespace supertac {

float contact_level(std::span<const float> truth, std::size_t pixels) {
  constexpr double kSigmas = 6, kMost = 0.1, kSigmasOf95 = 1.645;
  constexpr std::size_t kShare = 10, kLeastFrames = 3, kMostFrames = 200;
  const std::size_t frames = truth.size() / pixels;
  std::vector<double> sums(frames);
  for (std::size_t i = 0; i < frames * pixels; ++i) sums[i / pixels] += double{truth[i]};
  std::vector<std::size_t> quiet(frames);
  std::iota(quiet.begin(), quiet.end(), std::size_t{0});
  std::ranges::stable_sort(quiet, {}, [&](std::size_t f) { return sums[f]; });
  quiet.resize(std::min(frames / kShare, kMostFrames));
  if (quiet.size() < kLeastFrames) return 0;
  std::vector<double> values;
  for (const std::size_t f : quiet)
    for (const float v : truth.subspan(f * pixels, pixels)) values.push_back(double{v});
  const double rest = median(values);
  const double noise = kSigmas * (quantile(values, 0.95) - rest) / kSigmasOf95;
  return noise <= kMost ? static_cast<float>(rest + noise) : 0;
}

}  // namespace supertac
