// What pictures simple methods draw, beside which a network is scored.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"

namespace supertac {

/// A way to a picture without a network, to show what the network gains. It gets the network's input (a
/// window, normalised when the scaling says so) and nothing else.
struct Baseline {
  std::string name;
  /// input [T][signals], any T beyond the delay of the windows (ridge: their own); out
  /// [height][width] of the targets. Throws std::invalid_argument on other sizes.
  std::function<void(std::span<const float> input, std::span<float> out)> predict;
};

/// The most examples that a baseline is fitted to, evenly spread over those given. All throw
/// std::invalid_argument where there is none.
constexpr std::size_t kFitWindows = 20000;

/// "mean_image": the mean target of the training examples, whatever the input holds.
Baseline mean_image(const WindowSet& windows, std::span<const std::uint32_t> train);

/// Enlarges a frame of rows x columns taxels by a whole factor, by cubic convolution (Keys 1981, a = -1/2,
/// also called Catmull-Rom) along both axes. Taxels lie in the middle of equal cells, which the pixels
/// divide, so pixel p of a row lies at u = (p + 1/2) / scale - 1/2 in units of taxels. Taxels beyond the edge
/// repeat the outermost.
/// frame [rows][columns], out [rows * scale][columns * scale]; it throws std::invalid_argument on other
/// sizes.
std::function<void(std::span<const float> frame, std::span<float> out)> bicubic_enlargement(int rows,
                                                                                            int columns,
                                                                                            int scale);

/// "bicubic": a x + b, where x is the bicubic interpolation of the frame that a window shows (the mean of
/// each taxel's channels), with the line of least squares over all pixels of the training examples, whose
/// targets are y:
///   a = cov(x, y) / var(x), 0 where x never changes;   b = mean(y) - a mean(x)
/// It turns signal into height as well as two numbers can.
Baseline upsampled_frame(const WindowSet& windows, std::span<const std::uint32_t> train);

/// Told how much of `all` is done, some times a second; may throw to end the fit.
using FitProgress = std::function<void(std::size_t done, std::size_t all)>;

/// "ridge": ridge regression from the window, the best picture that is a linear function of the signals.
///   features  the window's signals averaged over 16 equal stretches of time (over T < 16 frames: each
///             frame; fewer for more than 128 signals, so that there are at most 2048), and a constant:
///             f = 257 for 4x4
///   weights   W = (X'X + penalty D)^-1 X'Y in double precision by Cholesky; X [n,f], Y [n,pixels]; D is 1
///             for each feature and 0 for the constant (Hoerl & Kennard 1970)
///   penalty   the one of 1e-5 .. 10, times the mean of X'X's diagonal, with the least squared error on every
///             fifth pass when fitted to the others (on the last fifth of the windows of a single pass); the
///             test side has no part in it
/// The weights have the same bits on every processor and for any number of threads (docs/determinism.md).
/// Throws std::runtime_error when X'X + penalty D is not positive definite.
Baseline ridge(const WindowSet& windows, std::span<const std::uint32_t> train,
               const FitProgress& progress = {});

using Baselines = std::vector<Baseline>;

/// mean_image, bicubic and ridge, in this order.
Baselines fit_baselines(const WindowSet& windows, std::span<const std::uint32_t> train,
                        const FitProgress& progress = {});

}  // namespace supertac
