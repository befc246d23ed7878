// A network's window of the newest frames, as a sensor sends them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "data/recordings/recording.h"
#include "data/recordings/resample.h"

namespace supertac {

struct LiveWindowSettings {
  int timesteps = 256;                 ///< T, samples per window; 1: each frame as it is, whatever rate_hz
  std::size_t signals = rig::kTaxels;  ///< in a frame
  double rate_hz = 300;
  Scaling scaling = {};
  double filter_s = 0;                ///< moving average to apply to the frames; 0 = none
  double frame_period_s = 1.0 / 300;  ///< of the sensor
};

/// From a sensor's frames to a network's window, as they come: filter, rate and scaling that training saw.
///
///   filtered[n] = mean of the frames in (t_n - filter_s + period/2, t_n]
///   samples     = Resampler of the filtered frames, anew after every gap
///
/// After every frame window() is the last T samples: bit for bit the last window of WindowSet for a recording
/// that ends with this frame. Where several frames make a sample, it is complete with the last of them.
/// Without losses the average is over round(filter_s / period) frames, as in the simulator. Memory is that of
/// one window, and of the frames that the average is over.
class LiveWindow {
 public:
  /// The settings are those of a model, or checked as WindowSettings are.
  explicit LiveWindow(const LiveWindowSettings& settings);

  /// A frame with a signal or a time that is not finite is taken as lost, one that is not later than the one
  /// before is left out.
  /// Throws std::invalid_argument when the frame has another number of signals.
  void push(double time_s, std::span<const float> frame);

  /// The window that ends with the newest frame, [T][signals], oldest sample first. False, and `out`
  /// untouched, before a run without gap spans T samples. Throws std::invalid_argument when `out` has
  /// another size.
  bool window(std::span<float> out) const;

  /// Silences, or steps back, longer than longest_silence_s(): all started anew.
  std::size_t gaps() const { return gaps_; }

 private:
  void average(double time_s, std::span<const float> frame);

  LiveWindowSettings settings_;
  Resampler resampler_;
  std::vector<float> ring_;  // sample j of the run stands at j modulo T
  std::optional<double> newest_s_;
  std::vector<double> recent_s_;  // times of the frames that the average is over
  std::vector<float> recent_;     // and their signals
  FrameMean mean_;
  std::vector<float> average_;
  std::size_t gaps_ = 0;
};

}  // namespace supertac
