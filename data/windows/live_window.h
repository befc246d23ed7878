#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "data/recordings/recording.h"
#include "data/recordings/resample.h"

namespace supertac {

struct LiveWindowSettings {
  int timesteps = 256;            ///< T, samples per window; 1: each frame as it is, whatever rate_hz
  std::size_t signals = kTaxels;  ///< in a frame
  double rate_hz = 300;
  Scaling scaling = {};
  double filter_s = 0;                ///< moving average to apply to the frames; 0 = none
  double frame_period_s = 1.0 / 300;  ///< of the sensor
  double max_gap_s = 0.05;            ///< longer silence is a gap no window crosses; at least kGapPeriods
};

/// From a sensor's frames to a network's window, as they come: filter, rate and scaling that training saw,
/// nothing later than the newest frame.
///
///   filtered[n] = mean of the frames in (t_n - filter_s + period/2, t_n]
///   sample k    = scaled mean of the filtered frames in (e - (k+1)/rate, e - k/rate], k = T-1 ... 0
///
/// where e is the window's end. A sample without frames repeats the one before it. Without losses the average
/// is over round(filter_s / period) frames, as in the simulator.
///
/// window() ends at e = t_newest + min(period, 1/rate) / 2, so a window for every frame, whatever the phase
/// to the model's rate. window_until(c_j + 1/(2 rate)) is, bit for bit, the window of WindowSet whose last
/// frame is j; where the sensor's rate is the model's, or an odd multiple of it, every such window is also a
/// window(). Memory is that of the frames within T / rate_hz + 0.2 s.
class LiveWindow {
 public:
  struct Counters {
    std::size_t frames = 0;  ///< taken
    std::size_t gaps =
        0;  ///< silences longer than max_gap_s, or steps of the time back by more: all starts anew
    std::size_t damaged = 0;  ///< a voltage or the time is not finite: taken as lost
    std::size_t late = 0;     ///< not later than the frame before: left out
  };

  /// Throws std::invalid_argument on settings out of range.
  explicit LiveWindow(const LiveWindowSettings& settings);

  /// Throws std::invalid_argument when the frame has another number of signals.
  void push(double time_s, std::span<const float> volts);

  /// The window that ends with the newest frame, [T][signals], oldest sample first. False, and `out`
  /// untouched, before a run without gap spans T samples. Throws std::invalid_argument when `out` has
  /// another size.
  bool window(std::span<float> out) { return window_until(end_s(), out); }
  /// The same for a window that ends at `end_s`, at most 0.1 s before the newest frame.
  bool window_until(double end_s, std::span<float> out);

  const Counters& counters() const { return counters_; }

 private:
  /// The frames of the last `span_s` seconds.
  class Recent {
   public:
    Recent(double span_s, std::size_t signals) : span_s_(span_s), signals_(signals) {}
    void push(double time_s, std::span<const float> volts);
    void clear();
    std::size_t count() const { return times_.size() - first_; }
    double time_s(std::size_t i) const { return times_[first_ + i]; }
    std::span<const float> volts(std::size_t i) const {
      return std::span(volts_).subspan((first_ + i) * signals_, signals_);
    }
    double newest_s() const { return times_.back(); }

   private:
    double span_s_;
    std::size_t signals_;
    std::vector<double> times_;
    std::vector<float> volts_;
    std::size_t first_ = 0;
  };

  double end_s() const;

  LiveWindowSettings settings_;
  Recent raw_, filtered_;
  FrameMean mean_;
  std::vector<float> average_;  // of mean_
  double run_begin_s_ = 0;
  Counters counters_;
};

}  // namespace supertac
