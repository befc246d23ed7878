#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/samples/pairs.h"
#include "data/scores/baselines.h"

namespace supertac {

/// What pairs reach without a network: the mean target; and the mean over the input's channels enlarged
/// (nearest, bicubic), followed by the line a x + b that fits the training targets best.
class PairBaselines {
 public:
  /// Fitted to at most kFitWindows of `train`, evenly spread. Throws std::invalid_argument when it is empty.
  PairBaselines(const PairSet& pairs, const ChannelScaling& scaling, std::span<const std::uint32_t> train);

  static const std::vector<std::string>& names();  ///< mean_image, nearest, bicubic
  /// Baseline k's picture of pair i, [sH][sW].
  void predict(std::size_t k, std::size_t i, std::span<float> out) const;

 private:
  struct Enlarged {
    Upsampling upsampling;
    double slope = 0, intercept = 0;
  };
  void enlarge(const Enlarged& enlarged, std::size_t i, std::span<float> out) const;
  void fit(Enlarged& enlarged, std::span<const std::uint32_t> chosen);

  const PairSet& pairs_;
  ChannelScaling scaling_;
  std::vector<float> mean_;
  std::vector<Enlarged> enlarged_;
};

}  // namespace supertac
