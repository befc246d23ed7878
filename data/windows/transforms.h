// What is done to the numbers of one window, as functions of the numbers alone: it is brought to its own rest
// and gain, and varied in training.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "data/sensors/taxel_array.h"

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
///   rest_k = the 5th percentile over the window of signal k,  top_k = its third largest sample
///   g      = max(kLeastGain, max_k (top_k - kRestRemoved rest_k))
///   x[t,k] <- clip((x[t,k] - kRestRemoved rest_k) / g, 0, 1)
/// The gain leaves room for the rest that stays: a finger that is pressed hard on a flat plate looks like
/// that, and not like noise at full gain (ghosts on unseen plates: 20 % of the flat pictures with top_k -
/// rest_k, 7 % so). Percentiles are taken in steps of 1/256. Nothing but the window is used: a live window is
/// normalised like one of training, and no state has to settle after a start. What is lost is how hard the
/// finger is pressed. `window`: [T][signals], values in [0,1]. Throws std::invalid_argument when the window
/// is empty, no multiple of `signals`, or of over 65,535 samples.
void normalise_window(std::span<float> window, std::size_t signals);

/// Changes of a training window that imitate what differs between trials: how deep the finger is pressed,
/// gain, rest level, dead taxels, noise. Each magnitude is off at 0. Magnitudes are in units of the
/// scaled signal (0 = rest, 1 = pressed hard).
struct AugmentSettings {
  double lift = 0;        ///< the finger carried higher: 0 .. lift is taken from every signal, down to 0
  double gain = 0;        ///< one factor per window, 1/(1+gain) .. 1+gain
  double taxel_gain = 0;  ///< one factor per signal (taxel and channel), 1/(1+taxel_gain) .. 1+taxel_gain
  double offset = 0;      ///< one shift per signal, -offset .. offset
  double noise = 0;       ///< standard deviation of noise that is independent per sample and signal
  int dropped = 0;        ///< 0 to `dropped` taxels, each number equally likely, read 0 (rest) throughout

  bool any() const {
    return lift > 0 || gain > 0 || taxel_gain > 0 || offset > 0 || noise > 0 || dropped > 0;
  }
};

/// What training does unless told otherwise (bench/results/parts.md).
inline constexpr AugmentSettings kStandardAugmentation{
    .lift = 0.4, .gain = 0.5, .taxel_gain = 0.3, .offset = 0.05, .noise = 0.02, .dropped = 2};

/// Throws std::invalid_argument naming the setting that is negative, not finite, or above the array's taxels
/// (dropped).
void check(const AugmentSettings& settings, const TaxelArray& array = {});

/// Changes a window [T][signals] of an array in place:
///   x[t,k] <- clip(g g_k max(x[t,k] - l, 0) + o_k + noise n[t,k], 0, 1),  0 for a dropped taxel's signals k
/// A factor is 1 + m v for v >= 0 and 1/(1 - m v) below, v uniform in [-1,1): as often half as twice.
/// n is the sum of four 16-bit uniforms with mean 0 and variance 1, |n| <= 3.5: its tails are lighter than
/// normal ones, and it costs 2 ns per value where a normal one costs 20.
/// A pure function of (settings, seed, sample, window): `sample` counts the windows drawn since training
/// began, so a run resumed at a step sees the same changes. A term that is off leaves the others' numbers
/// unchanged.
/// Throws std::invalid_argument when the window is no whole number of frames; as check().
void augment(const AugmentSettings& settings, std::uint64_t seed, std::uint64_t sample,
             std::span<float> window, const TaxelArray& array = {});

}  // namespace supertac
