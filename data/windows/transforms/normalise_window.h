#pragma once

#include <cstddef>
#include <span>

namespace supertac {

/// The least that counts as being pressed, in units of the scaled signal: a quieter window is not made
/// louder.
constexpr float kLeastGain = 0.15F;

/// The share of a taxel's rest that is taken away. Wide textures never let go of a taxel: without its rest
/// their signal would be that of a narrow one.
constexpr float kRestRemoved = 0.5F;
constexpr std::size_t kRestShare = 20;  ///< one sample in 20 lies below the rest
constexpr std::size_t kTopRank = 3;     ///< two samples may lie above the top: a glitch is no touch

/// Brings a window of scaled signals to its own rest and gain, so that a finger that is pressed harder, or
/// whose taxels are pressed a little all the time, is seen like any other:
///   rest_k = the 5th percentile over the window of taxel k,  top_k = its third largest sample
///   g      = max(kLeastGain, max_k (top_k - kRestRemoved rest_k))
///   x[t,k] <- clip((x[t,k] - kRestRemoved rest_k) / g, 0, 1)
/// The gain leaves room for the rest that stays: a finger that is pressed hard on a flat plate looks like
/// that, and not like noise at full gain (ghosts on unseen plates: 20 % of the flat pictures with top_k -
/// rest_k, 7 % so). Percentiles are taken in steps of 1/256. Nothing but the window is used: a live window is
/// normalised like one of training, and no state has to settle after a start. What is lost is how hard the
/// finger is pressed. `window`: [T][taxels], values in [0,1]. Throws std::invalid_argument when the window is
/// empty, no multiple of `taxels`, or of over 65,535 samples.
void normalise_window(std::span<float> window, std::size_t taxels);

}  // namespace supertac
