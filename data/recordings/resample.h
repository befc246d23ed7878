// How recorded signals become what a model sees: in what range they lie, which taxels feel anything, and one
// rate.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
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
  Resampler(std::size_t signals, double rate_hz, const Scaling& scaling)
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
    scaling_(newest_);
    give(j, std::span<const float>(newest_));
  }

 private:
  double rate_hz_, begin_s_ = 0;
  Scaling scaling_;
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
      run;               ///< [frames]: frames since the pass began or since the last gap, itself included
  std::size_t held = 0;  ///< samples for which no frame arrived: they repeat the one before
  std::size_t gaps = 0;  ///< places where the recording is interrupted: longest_silence_s()
  std::size_t frames() const { return run.size(); }
};

/// A longer silence of a sensor is a gap, never filled and crossed by no window: three of its periods, and
/// 50 ms or more.
inline double longest_silence_s(double period_s) { return std::max(0.05, 3 * period_s); }

struct ResampleSettings {
  double rate_hz = 300;
  bool frames_apart = false;  ///< each recorded frame is one sample of its own, whatever lies between
  Scaling scaling = {};
};

/// Puts a recording onto rate_hz, each run between two gaps by a Resampler; samples without a frame are
/// counted in `held`. position[j] is the position at the time that sample j stands for, linear between
/// recorded frames. Causal but for half a period (5 ms at 100 Hz). A recording made at rate_hz comes out as
/// it is.
/// Throws std::runtime_error when the recording breaks a rule (problem_of()), std::invalid_argument for a
/// rate far above the recording's. The settings must be positive.
Track resample(const Recording& recording, const ResampleSettings& settings);

/// Called before each recording of a folder is read, with how many were read and how many there are; what it
/// throws ends the reading.
using ReadingWatch = std::function<void(std::size_t done, std::size_t all)>;

/// Why these signals cannot be those of a sensor whose file states this scale, as the end of a sentence:
/// "from 0 to 1, the sensor's range is 40 to 900 counts"; empty where they can. More than half of them lie
/// beyond the range by a quarter of it, or they are shares of 0 to 1 under a range at least ten times as
/// wide. Imports and training ask it, and the Python package does the same (python/supertac/recordings.py).
std::string contradiction(std::span<const float> signals, const SignalScale& scale);

/// Gathers over recordings how far each taxel's signals go. A simulation whose body does not fit its scenes
/// leaves taxels with noise and drift alone, which stay within a tenth of the range.
class FeltTaxels {
 public:
  void add(const Recording& recording);
  /// Of the simulated recordings, all of one array: those whose signals stay within a tenth of the range.
  /// None while nothing simulated was added.
  std::vector<int> unfelt() const;
  /// "49 of 60 taxels feel nothing: 0-9, 12; ..." and what helps, where that holds of more than three
  /// quarters: of a dome that slides over one strip of a plate half of the taxels feel it. Else nothing.
  std::string complaint() const;

 private:
  TaxelArray array_;
  double span_ = 0;
  bool flat_ = true;
  std::vector<float> low_, high_;  // of each signal
};

/// The signals of some recordings, an even sample of each: 16 frames or more, of long ones a frame in 64, and
/// of more than 16 million frames fewer.
class SignalRange {
 public:
  /// Of a folder's recordings, only these plates when any are named. Throws as list_recordings() and
  /// read_recording(), and FileError for signals that are not of the sensor that a recording states
  /// (contradiction()), unless `any_signals`.
  static SignalRange of_folder(const std::string& dir, const std::vector<std::string>& plates,
                               const ReadingWatch& watch = {}, bool any_signals = false);
  void add(const Recording& recording);

  /// Share of the signals that the scaling makes all the same: those below rest - span, and those more than
  /// a quarter of the span above rest.
  double clipped(const Scaling& scaling) const;
  /// Rest and span that the first recording states: the rig's in older ones.
  const Scaling& stated() const { return stated_; }
  /// The range that the recordings state (the rig's in older ones) where it clips no more than a twentieth
  /// and the signals fill a tenth of it; otherwise rest is the level that one signal in 200 exceeds, and span
  /// reaches from there to the level that one in 200 stays below, and a tenth further; the other way round
  /// where pressing raises the signals.
  Scaling fitted() const;
  /// "68 to 102.3", all but the outermost 200th on both sides.
  std::string text() const;
  /// All of the sample, in ascending order.
  const std::vector<float>& values() const;
  const FeltTaxels& felt() const { return felt_; }

 private:
  double level(double share) const;
  void thin_out();

  mutable std::vector<float> values_;
  Scaling stated_;
  FeltTaxels felt_;
  mutable bool sorted_ = true;
  // How often it was thinned out, as a power of two, and frames to the next of the sample; before the first
  // time every recording begins with one.
  std::size_t factor_ = 1, next_ = 0;
};

}  // namespace supertac
