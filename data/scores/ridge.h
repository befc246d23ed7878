#pragma once

#include "data/scores/baselines.h"

namespace supertac {

/// Ridge regression from the window: the best picture that is a linear function of the signals.
///   features  the window's signals averaged over 16 equal stretches of time (over T < 16 frames: each
///             frame; fewer for more than 128 signals, so that there are at most 2048), and a constant:
///             f = 257 for 4x4
///   weights   W = (X'X + penalty D)^-1 X'Y in double precision by Cholesky; X [n,f], Y [n,pixels]; D is 1
///             for each feature and 0 for the constant (Hoerl & Kennard 1970)
///   penalty   the one of 1e-5 .. 10, times the mean of X'X's diagonal, with the least squared error on every
///             fifth pass when fitted to the others (on the last fifth of the windows of a single pass); the
///             test side has no part in it
/// The weights have the same bits on every processor and for any number of threads (docs/determinism.md).
class Ridge : public Baseline {
 public:
  /// Fits to at most kFitWindows windows, evenly spread. Throws std::invalid_argument when train is empty,
  /// std::runtime_error when X'X + penalty D is not positive definite.
  Ridge(const WindowSet& windows, std::span<const std::uint32_t> train, const FitProgress& progress = {});
  std::string name() const override { return "ridge"; }
  void predict(std::span<const float> window, std::span<float> out) const override;
  /// As chosen, in units of the mean of X'X's diagonal.
  double penalty() const { return penalty_; }

 private:
  std::size_t timesteps_, signals_, pixels_;
  double penalty_ = 0;
  std::vector<float> weights_;  // [f][pixels], the constant last
};

}  // namespace supertac
