// What a spread means for a pixel.
#pragma once

#include <algorithm>

namespace supertac {

/// Below this a spread means nothing: what rounding to 8 bits costs twice over.
inline constexpr float kLeastSpread = 0.01F;
inline float at_least(float spread) { return std::max(spread, kLeastSpread); }

/// Half the width of the interval that holds the truth of nine pixels in ten, in units of the spread: 1.1
/// and 1.3 were found on 6_Ridges and 4_Ridges, each left out of the training (trial 1, one seed each); the
/// larger is taken.
inline constexpr double kIntervalFactor = 1.3;

}  // namespace supertac
