#include "data/scores/pair_baselines.h"

#include <algorithm>
#include <stdexcept>

namespace supertac {

const std::vector<std::string>& PairBaselines::names() {
  static const std::vector<std::string> kNames = {"mean_image", "nearest", "bicubic"};
  return kNames;
}

PairBaselines::PairBaselines(const PairSet& pairs, const ChannelScaling& scaling,
                             std::span<const std::uint32_t> train)
    : pairs_(pairs), scaling_(scaling), mean_(pairs.target_height() * pairs.target_width()) {
  if (train.empty()) throw std::invalid_argument("baselines: there is no pair to fit to");
  const std::vector<std::uint32_t> chosen = spread(train, kFitWindows);
  std::vector<double> sum(mean_.size());
  std::vector<float> target(mean_.size());
  for (const std::uint32_t i : chosen) {
    pairs.target(i, target);
    for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += double{target[p]};
  }
  for (std::size_t p = 0; p < sum.size(); ++p)
    mean_[p] = static_cast<float>(sum[p] / static_cast<double>(chosen.size()));
  for (const auto kind : {Upsampling::Kind::nearest, Upsampling::Kind::bicubic}) {
    enlarged_.push_back({Upsampling(kind, static_cast<int>(pairs.height()), static_cast<int>(pairs.width()),
                                    static_cast<int>(pairs.scale()))});
    fit(enlarged_.back(), chosen);
  }
}

// The mean over the scaled channels, enlarged.
void PairBaselines::enlarge(const Enlarged& enlarged, std::size_t i, std::span<float> out) const {
  const std::size_t channels = pairs_.channels();
  std::vector<float> input(channels * pairs_.height() * pairs_.width());
  std::vector<float> frame(input.size() / channels);
  pairs_.input(i, scaling_, input);
  for (std::size_t k = 0; k < input.size(); ++k)
    frame[k / channels] += input[k] / static_cast<float>(channels);
  enlarged.upsampling(frame, out);
}

void PairBaselines::fit(Enlarged& enlarged, std::span<const std::uint32_t> chosen) {
  std::vector<float> image(mean_.size()), target(mean_.size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const std::uint32_t i : chosen) {
    enlarge(enlarged, i, image);
    pairs_.target(i, target);
    for (std::size_t p = 0; p < image.size(); ++p) {
      const double x = double{image[p]}, y = double{target[p]};
      sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
  }
  const double n = static_cast<double>(chosen.size()) * static_cast<double>(image.size());
  const double variance = sxx - sx * sx / n;
  enlarged.slope = variance > 1e-12 * n ? (sxy - sx * sy / n) / variance : 0;
  enlarged.intercept = (sy - enlarged.slope * sx) / n;
}

void PairBaselines::predict(std::size_t k, std::size_t i, std::span<float> out) const {
  if (k == 0) {
    std::copy(mean_.begin(), mean_.end(), out.begin());
    return;
  }
  const Enlarged& enlarged = enlarged_.at(k - 1);
  enlarge(enlarged, i, out);
  for (float& v : out) v = static_cast<float>(enlarged.slope * double{v} + enlarged.intercept);
}

}  // namespace supertac
