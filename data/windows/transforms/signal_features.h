// Features of a window that tell of the sensor, not of the texture under it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "data/sensors/taxel_array.h"

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
/// About 64 frames, evenly spread, are looked at. A single frame is its own features: how its taxels go
/// together tells the skin, and rows that are exchanged do not go together. Throws std::invalid_argument
/// unless the window holds whole frames, one or 16 at least, and `out` has signal_feature_count numbers.
void signal_features(std::span<const float> window, const TaxelArray& array, std::span<float> out);
std::vector<float> signal_features(std::span<const float> window, const TaxelArray& array);

}  // namespace supertac
