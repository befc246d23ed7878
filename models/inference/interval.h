// What a predicted error means for a pixel.
#pragma once

#include <algorithm>
#include <span>

#include "data/sensors/taxel_array.h"

namespace supertac {

/// Below this a predicted error means nothing: what rounding to 8 bits costs twice over.
inline constexpr float kLeastPredictedError = 0.01F;
inline float at_least(float predicted_error) { return std::max(predicted_error, kLeastPredictedError); }

/// How far a whole picture may be off, for telling good ones from bad ones, 0 to 1: what SSIM would lose to a
/// truth that differs from the picture by independent errors of size s,
///   1 - mean over squares of 7x7 pixels of (2 v + C) / (2 v + mean s^2 + C),   C = .005,
/// v the picture's variance in a square: an error spoils a faint texture sooner than a strong one. In windows
/// of trial 1 that were left out it tells SSIM below .8 with AUROC .79; the predicted error alone does with
/// .63 (means of eight networks; bench/results). picture, predicted error: [height][width] of the grid.
double doubt_of(std::span<const float> picture, std::span<const float> predicted_error,
                const ImageGrid& grid);

/// Half the width of the interval that holds the truth of nine pixels in ten, in units of the predicted
/// error: 1.1 to 1.45 were found on 6_Ridges and 4_Ridges, each left out of the training (trial 1, one seed
/// each); the largest is taken.
inline constexpr double kIntervalFactor = 1.45;

}  // namespace supertac
