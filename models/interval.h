// What a spread means for a pixel.
#pragma once

#include <algorithm>

namespace supertac {

/// Below this a spread means nothing: what rounding to 8 bits costs twice over.
inline constexpr float kLeastSpread = 0.01F;
inline float at_least(float spread) { return std::max(spread, kLeastSpread); }

/// Half the width of the interval that holds the truth of nine pixels in ten, in units of the spread:
/// measured on real passes that networks had not seen (bench/results/README.md).
inline constexpr double kIntervalFactor = 2.5;

}  // namespace supertac
