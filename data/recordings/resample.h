#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

/// Scales a signal to [0,1], 1 = pressed hard: clip((rest - V) / span, 0, 1). The span is below 0 where
/// pressing raises the signal.
struct Scaling {
  double rest_volts = SignalScale{}.rest, span_volts = SignalScale{}.span;
  bool per_window = false;  ///< each window is then brought to its own rest and gain: normalise_window()
  float operator()(float volts) const;
  /// Scales every value in place.
  void operator()(std::span<float> volts) const;
};

/// Mean of some frames, summed in double precision in the order they are added: what resample() and
/// LiveWindow make a sample of, so that both give the same bits.
class FrameMean {
 public:
  /// `signals`: in a frame.
  explicit FrameMean(std::size_t signals) : sum_(signals) {}
  void clear();
  void add(std::span<const float> volts);
  std::size_t count() const { return count_; }
  /// Of at least one frame.
  void volts(std::span<float> mean) const;

 private:
  std::vector<double> sum_;
  std::size_t count_ = 0;
};

/// Time stamps are rounded: a frame up to this share of a period past the end of a sample still belongs to
/// it.
constexpr double kCellSlack = 1e-6;

/// A recording on an even time grid.
struct Track {
  std::vector<float> samples;           ///< [frames][signals], scaled
  std::vector<float> position_mm;       ///< [frames][2] (x, y), NaN where unknown
  std::vector<float> lift_mm;           ///< [frames], as Recording's; 0 where it has none
  std::vector<std::uint32_t> recorded;  ///< [frames]: the recorded frame nearest in time, whose truth it has
  std::vector<std::uint32_t>
      run;                  ///< [frames]: frames since the pass began or since the last gap, itself included
  std::size_t held = 0;     ///< frames for which no sample arrived: they repeat the one before
  std::size_t gaps = 0;     ///< places where the recording is interrupted for longer than max_gap_s
  std::size_t damaged = 0;  ///< recorded frames with a voltage that is not finite: taken as lost
  std::size_t frames() const { return run.size(); }
};

/// A silence of at most so many periods is never a gap, however slow the sensor.
constexpr double kGapPeriods = 3;

/// Sample rate of a window; for single frames 1000 times the sensor's, so that no two frames fall into one
/// sample.
inline double sample_rate_hz(int timesteps, double rate_hz, double frame_period_s) {
  return timesteps == 1 ? 1000 / frame_period_s : rate_hz;
}

struct ResampleSettings {
  double rate_hz = 300;
  /// Longer silence between two recorded frames is a gap, never filled; at least kGapPeriods of the
  /// recording.
  double max_gap_s = 0.05;
  bool frames_apart = false;  ///< each recorded frame is one sample of its own, whatever lies between
  std::optional<Scaling> scaling = Scaling{};  ///< empty: the samples stay as recorded
};

/// Puts a recording onto rate_hz. Between two gaps frame j stands for the time c = t_first + j / rate:
///   samples[j]  = scaled mean of the recorded frames in (c - 1/(2 rate), c + 1/(2 rate)], or samples[j-1]
///   when
///                 there is none (counted in `held`)
///   position[j] = position at c, linear between recorded frames
/// Causal but for half a period (1.7 ms at 300 Hz): LiveWindow gives the same samples while frames arrive. A
/// recording made at rate_hz comes out as it is.
/// Throws std::invalid_argument on settings that are not positive, std::runtime_error when the sizes of the
/// recording's arrays disagree or its time stamps do not increase.
Track resample(const Recording& recording, const ResampleSettings& settings);

}  // namespace supertac
