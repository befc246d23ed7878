// Where signals rest, told from frames in which somebody pressed.
#pragma once

#include <span>
#include <vector>

namespace supertac {

/// The rest of each signal, from signals [signal][frame] of an array that is touched here and there. A
/// frame's total is the sum of its signals in the pressed direction (of several channels a taxel: of their
/// distances from the medians). Nothing touches where the total is within four standard deviations, of its
/// own noise, of the level that a tenth of all frames stay below; a rest is the median over these frames. So
/// each taxel may be pressed for most of the time, if the array is let go for a tenth of it.
std::vector<double> rests_between_touches(std::span<const std::vector<float>> signals, int channels,
                                          bool rises);

}  // namespace supertac
