// What pictures simple methods draw, beside which a network is scored.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"

namespace supertac {

/// A way to a picture without a network, to show what the network gains. It gets the network's input (a
/// window, normalised when the scaling says so) and nothing else.
class Baseline {
 public:
  virtual ~Baseline() = default;
  virtual std::string name() const = 0;
  /// input [T][signals], any T >= 1; out [height][width] of the targets. Throws std::invalid_argument on
  /// other sizes.
  virtual void predict(std::span<const float> input, std::span<float> out) const = 0;
};

/// The mean target of the training examples, whatever the input holds.
class MeanImage : public Baseline {
 public:
  /// Throws std::invalid_argument when train is empty.
  MeanImage(const WindowSet& windows, std::span<const std::uint32_t> train);
  std::string name() const override { return "mean_image"; }
  void predict(std::span<const float> input, std::span<float> out) const override;

 private:
  TaxelArray array_;
  std::vector<float> image_;
};

/// Enlarges a frame of rows x columns taxels by a whole factor, by cubic convolution (Keys 1981, a = -1/2,
/// also called Catmull-Rom) along both axes. Taxels lie in the middle of equal cells, which the pixels
/// divide, so pixel p of a row lies at u = (p + 1/2) / scale - 1/2 in units of taxels. Taxels beyond the edge
/// repeat the outermost.
class Bicubic {
 public:
  /// Throws std::invalid_argument when a size is below 1.
  Bicubic(int rows, int columns, int scale);
  /// frame [rows][columns], out [rows * scale][columns * scale]. Throws std::invalid_argument on other
  /// sizes.
  void operator()(std::span<const float> frame, std::span<float> out) const;

 private:
  std::size_t rows_, columns_;
  std::vector<float> down_, across_;  // [pixels][taxels]: weights of the taxels of a line on its pixels
};

/// a x + b, where x is the bicubic interpolation of the frame that a window shows (the mean of each taxel's
/// channels), with the line of least squares over all pixels of the training examples, whose targets are y:
///   a = cov(x, y) / var(x), 0 where x never changes;   b = mean(y) - a mean(x)
/// It turns signal into height as well as two numbers can.
class UpsampledFrame : public Baseline {
 public:
  /// Throws std::invalid_argument when train is empty.
  UpsampledFrame(const WindowSet& windows, std::span<const std::uint32_t> train);
  std::string name() const override { return "bicubic"; }
  void predict(std::span<const float> input, std::span<float> out) const override;
  double slope() const { return slope_; }
  double intercept() const { return intercept_; }

 private:
  std::span<const float> shown(std::span<const float> input) const {
    return input.last(array_.signals() * (1 + delay_frames_)).first(array_.signals());
  }

  TaxelArray array_;
  std::size_t delay_frames_;
  Bicubic upsampling_;
  double slope_ = 0, intercept_ = 0;
};

/// Told how much of `all` is done, some times a second; may throw to end the fit.
using FitProgress = std::function<void(std::size_t done, std::size_t all)>;

/// The most examples that a baseline is fitted to.
constexpr std::size_t kFitWindows = 20000;

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

using Baselines = std::vector<std::unique_ptr<Baseline>>;

/// mean_image, bicubic and ridge, in this order. Each is fitted to at most
/// kFitWindows training examples, evenly spread over the list. Throws std::invalid_argument when train is
/// empty.
Baselines fit_baselines(const WindowSet& windows, std::span<const std::uint32_t> train,
                        const FitProgress& progress = {});

}  // namespace supertac
