// Says when a window is unlike those a network was trained on.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "autograd/tensor.h"
#include "data/sensors/taxel_array.h"
#include "layers/checkpoint.h"

namespace supertac {

/// Numbers of signal_features() of windows of so many frames: two for each signal, one for each pair of
/// neighbouring rows; of single frames one for each signal.
std::size_t signal_feature_count(const TaxelArray& array, std::size_t frames);

/// The features of a window x [T][signals] as a network takes it, in this order:
///   mean_k, for each signal
///   log(sd_k + 0.0005): a dead taxel is stiller than any that is pressed
///   lead_r = sum_k in row r of (x[t,k] x[t+L,k'] - x[t+L,k] x[t,k']), mean over t, the means taken off, as a
///            share of the rows' swing sqrt(E_r E_r+1) + 0.003; k' is the taxel of row r + 1 behind k,
///            L = T / 8, E_r the mean square of a row: rows slide over the same plate one after the other,
///            and exchanged cables turn the order round
/// Of longer windows 64 to 127 frames, evenly spread, are looked at. A single frame is its own features: how
/// its taxels go together tells the skin, and rows that are exchanged do not go together. Throws
/// std::invalid_argument unless the window holds whole frames, one or 16 at least, and `out` has
/// signal_feature_count numbers.
void signal_features(std::span<const float> window, const TaxelArray& array, std::span<float> out);
std::vector<float> signal_features(std::span<const float> window, const TaxelArray& array);

/// The Mahalanobis distance of a window's signal_features() z from those of the training windows (Lee et al.
/// 2018, with one class):
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
  static std::optional<Novelty> read(const SafetensorsFile& file, std::size_t features);
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
