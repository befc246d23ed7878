// Where a sensor's signals rest: told from frames in which somebody pressed, and followed while that changes.
#pragma once

#include <span>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

/// Takes a slow drift of the rest from the frames of a sensor whose file has "follow_rest_s", T below:
///   m_s    = mean of signal s over about 0.2 s (of one pole)
///   away   = the farthest that any m_s is from r_s in the pressed direction (of three axes: either way),
///            as a share of the range; the other way nothing presses
///   r_s   += (m_s - r_s) dt / T     while away < band, for a second already; else r_s stays
///   d_s   += ((m_s - r_s) / T - d_s) dt / T     at the same time: the drift in a second
///   signal = signal - r_s + scale.rest
/// r begins at scale.rest. The band is 0.03. It begins at 0.15, since the rest of a file may be old, and
/// shrinks as r follows; under a touch it grows by 2e-4 a second, or 1.25 times the fastest d_s (as a share
/// of the range) if that is more, up to 0.15, since what drifts then is seen only afterwards. So a touch of
/// 0.1 of the range that does not move is absorbed after six minutes, one of over 0.15 never
/// (normalise_window() calls less than that no press).
class RestTracker {
 public:
  explicit RestTracker(const Sensor& sensor);
  /// A frame as Sensor::arrange() gives it, in place; without "follow_rest_s" it stays. Signals that are no
  /// number stay so and change nothing. `time_s` increases; of a silence one second counts.
  void follow(double time_s, std::span<float> signals);

 private:
  SignalScale scale_;
  bool either_way_;
  double time_constant_s_, before_s_, free_s_ = 0, band_, fastest_ = 0;
  std::vector<double> mean_, rate_, rest_;
};

/// The rest of each signal, from signals [signal][frame] of an array that is touched here and there. A
/// frame's total is the sum of its signals in the pressed direction (of several channels a taxel: of their
/// distances from the medians). Nothing touches where the total is within four standard deviations, of its
/// own noise, of the level that a tenth of all frames stay below; a rest is the median over these frames. So
/// each taxel may be pressed for most of the time, if the array is let go for a tenth of it.
std::vector<double> rests_between_touches(std::span<const std::vector<float>> signals, int channels,
                                          bool rises);

}  // namespace supertac
