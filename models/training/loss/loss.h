// What SuperTac is trained on: the VAEs' losses and the picture's.
#pragma once

#include <array>
#include <string>

#include "models/networks/supertac_model.h"

namespace supertac {

/// total = a * sum over the VAEs of (reconstruction + beta KLD) + (1 - a) * (L2 + lambda (1 - SSIM)),
/// the paper's convex combination; reconstruction and L2 are mean squared errors. Without VAEs
/// L2 + lambda (1 - SSIM). supertac_loss() adds the predicted error's term.
struct LossWeights {
  double a = 0.2;       ///< share of the VAEs, 0..1
  double beta = 1e-3;   ///< of the Kullback-Leibler divergence
  double lambda = 0.1;  ///< of 1 - SSIM
  /// Throws std::invalid_argument outside 0 <= a <= 1, beta >= 0, lambda >= 0.
  void check() const;
};

/// Scalars; reconstruction and kld are sums over the VAEs, undefined where there are none, as is predicted
/// error. `total` alone is weighted.
struct Loss {
  Variable total, reconstruction, kld, l2, ssim, predicted_error;
};

/// The values of a Loss but for the predicted error's, which only `total` holds; 0 for a term that it has
/// not.
struct LossTerms {
  double total = 0, reconstruction = 0, kld = 0, l2 = 0, ssim = 0;
  std::array<double*, 5> all() { return {&total, &reconstruction, &kld, &l2, &ssim}; }
  void add(const LossTerms& other);
  /// "the loss is 0.1 (reconstruction 0.2, KLD 3, L2 0.1, SSIM 0.5)"; without VAEs without their terms.
  std::string text() const;
};
/// `share` times each term.
LossTerms terms_of(const Loss& loss, double share);

/// How much the squared error of the predicted error counts beside that of the picture.
inline constexpr double kPredictedErrorWeight = 0.1;

/// A truth whose pixels differ by less is flat.
inline constexpr real kLeastTexture = 0.01F;

/// The picture's part alone: total = L2 + lambda (1 - SSIM). picture and truth [N,H,W,1], truth in [-1,1].
/// Where the truth is flat the SSIM counts as 1: with no structure to compare, SSIM measures noise alone, and
/// its gradient would outweigh that of all textures. Throws std::invalid_argument when they differ in shape.
Loss picture_loss(const Variable& picture, const Tensor& truth, double lambda);

/// To the picture's loss kPredictedErrorWeight times the mean of (predicted error - |picture - truth|)^2 is
/// added, the picture taken as given: the predicted error learns the error, the picture does not learn to be
/// predictably wrong. truth [N,H,W,1] in [-1,1]. Throws std::invalid_argument when it does not fit the
/// output's picture.
Loss supertac_loss(const SuperTac::Output& output, const Tensor& truth, const LossWeights& weights);

}  // namespace supertac
