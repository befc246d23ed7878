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
  double rest = SignalScale{}.rest, span = SignalScale{}.span;
  bool per_window = false;  ///< each window is then brought to its own rest and gain: normalise_window()
  float operator()(float signals) const;
  /// Scales every value in place.
  void operator()(std::span<float> signals) const;
};

/// Mean of some frames, summed in double precision in the order they are added.
class FrameMean {
 public:
  /// `signals`: in a frame.
  explicit FrameMean(std::size_t signals) : sum_(signals) {}
  void clear();
  void add(std::span<const float> signals);
  /// Of at least one frame.
  void write(std::span<float> mean) const;

 private:
  std::vector<double> sum_;
  std::size_t count_ = 0;
};

/// Time stamps are rounded: a frame up to this share of a period past the end of a sample still belongs to
/// it.
constexpr double kCellSlack = 1e-6;

/// Number j of the sample that a frame belongs to, `since_begin_s` after its run's first frame: the least j
/// with since_begin_s <= (j + 1/2) / rate_hz.
std::size_t sample_at(double since_begin_s, double rate_hz);

/// From the frames of one run, which no gap interrupts, to samples on an even grid, as they come. The grid
/// begins at the run's first frame: sample j stands for the time t_first + j / rate_hz, and is the scaled
/// mean of the frames in (that - 1/(2 rate_hz), that + 1/(2 rate_hz)], or sample j-1 again where there are
/// none. Training, live pictures, the exported C code and the Python package have this one definition, so
/// what is drawn after a frame is what is drawn of a recording that ends with it.
class Resampler {
 public:
  /// `scaling`: nothing leaves the samples as they come.
  Resampler(std::size_t signals, double rate_hz, const std::optional<Scaling>& scaling)
      : rate_hz_(rate_hz), scaling_(scaling), mean_(signals), newest_(signals) {}
  /// The next frame begins a run.
  void restart() { samples_ = 0; }
  /// Samples of the run so far, the newest included, whose frames may not all have come.
  std::size_t samples() const { return samples_; }
  /// A frame [signals], later than those before it in its run. Calls give(j, sample), sample [signals], for
  /// every sample that it changes, in their order: those before it without a frame, and its own as far as its
  /// frames have come.
  template <class Give>
  void add(double time_s, std::span<const float> signals, const Give& give) {
    if (samples_ == 0) begin_s_ = time_s;
    const std::size_t j = sample_at(time_s - begin_s_, rate_hz_);
    if (samples_ <= j) mean_.clear();
    for (; samples_ < j; ++samples_) give(samples_, std::span<const float>(newest_));
    samples_ = j + 1;
    mean_.add(signals);
    mean_.write(newest_);
    if (scaling_) (*scaling_)(newest_);
    give(j, std::span<const float>(newest_));
  }

 private:
  double rate_hz_, begin_s_ = 0;
  std::optional<Scaling> scaling_;
  FrameMean mean_;             // of the newest sample's frames
  std::vector<float> newest_;  // that mean, scaled
  std::size_t samples_ = 0;
};

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

struct ResampleSettings {
  double rate_hz = 300;
  /// Longer silence between two recorded frames is a gap, never filled; at least kGapPeriods of the
  /// recording.
  double max_gap_s = 0.05;
  bool frames_apart = false;  ///< each recorded frame is one sample of its own, whatever lies between
  std::optional<Scaling> scaling = Scaling{};  ///< empty: the samples stay as recorded
};

/// Puts a recording onto rate_hz, each run between two gaps by a Resampler; samples without a frame are
/// counted in `held`. position[j] is the position at the time that sample j stands for, linear between
/// recorded frames. Causal but for half a period (1.7 ms at 300 Hz). A recording made at rate_hz comes out as
/// it is.
/// Throws std::invalid_argument on settings that are not positive, std::runtime_error when the sizes of the
/// recording's arrays disagree or its time stamps do not increase.
Track resample(const Recording& recording, const ResampleSettings& settings);

}  // namespace supertac
