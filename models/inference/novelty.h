// Says when a window is unlike those a network was trained on.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "autograd/tensor.h"
#include "layers/checkpoint.h"

namespace supertac {

/// The Mahalanobis distance of a window's features z (data/windows/transforms/signal_features.h) from those
/// of the training windows (Lee et al. 2018, with one class):
///   distance = |L^-1 (z - mean)| / sqrt(D),   covariance = L L^T
/// about 1 for a window like those of training. The network's own latents would not serve: training with
/// dropped taxels makes them blind to these. Nor would the VAEs' likelihood, which is high for any flat
/// signal (Xiao et al. 2020).
class Novelty {
 public:
  /// Of features [N,D]. Features that do not vary get a small variance. Throws std::invalid_argument unless N
  /// > D.
  explicit Novelty(const Tensor& features);
  /// As stored() wrote it; empty for a file without. Throws std::runtime_error naming path and tensor when
  /// the shapes are not those of so many features.
  static std::optional<Novelty> read(const SafetensorsFile& file, const std::string& path,
                                     std::size_t features);
  std::vector<StoredTensor> stored() const;

  /// Of features [D]. Throws std::invalid_argument for another number of them.
  double distance(std::span<const float> features) const;
  /// True beyond the distance that one training window in a thousand had, and a little more: windows of
  /// another trial lie farther out than those trained on.
  bool unlike_training(std::span<const float> features) const { return distance(features) > limit_; }
  double limit() const { return limit_; }

 private:
  Novelty() = default;
  std::vector<float> mean_;       // [D]
  std::vector<float> whitening_;  // L^-1, [D][D], lower triangle
  float limit_ = 0;
};

}  // namespace supertac
