// In what range a sensor's signals lie, and which of its taxels feel anything.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "data/recordings/resample.h"

namespace supertac {

/// Called before each recording of a folder is read, with how many were read and how many there are; what it
/// throws ends the reading.
using ReadingWatch = std::function<void(std::size_t done, std::size_t all)>;

/// Why these signals cannot be those of a sensor whose file states this scale, as the end of a sentence: "run
/// from 0 to 1 ..., the sensor's range is 40 to 900 counts"; empty where they can. More than half of them lie
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
  /// Throws std::runtime_error with the complaint where there is one.
  void check() const;

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
