#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/baselines.h"
#include "data/pairs.h"

namespace supertac {

/// What pairs reach without a network: the mean target; and the mean over the input's channels enlarged
/// (nearest, bicubic), followed by the line a x + b that fits the training targets best.
class PairBaselines {
 public:
  /// Fitted to at most kFitWindows of `train`, evenly spread. @throws std::invalid_argument when it is empty.
  PairBaselines(const PairSet& pairs, const ChannelScaling& scaling, std::span<const uint32_t> train);

  static const std::vector<std::string>& names();  ///< mean_image, nearest, bicubic
  /// Baseline k's picture of pair i, [sH][sW].
  void predict(size_t k, size_t i, std::span<float> out) const;

 private:
  struct Enlarged {
    Upsampling upsampling;
    double slope = 0, intercept = 0;
  };
  void enlarge(const Enlarged& enlarged, size_t i, std::span<float> out) const;
  void fit(Enlarged& enlarged, std::span<const uint32_t> chosen);

  const PairSet& pairs_;
  ChannelScaling scaling_;
  std::vector<float> mean_;
  std::vector<Enlarged> enlarged_;
};

}  // namespace supertac
