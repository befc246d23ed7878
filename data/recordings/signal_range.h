// In what range a sensor's signals lie.
#pragma once

#include <string>
#include <vector>

#include "data/recordings/resample.h"

namespace supertac {

/// The signals of some recordings, an even sample of them.
class SignalRange {
 public:
  /// Of a folder's recordings, only these plates when any are named. Throws as list_recordings() and
  /// read_recording().
  static SignalRange of_folder(const std::string& dir, const std::vector<std::string>& plates);
  void add(const Recording& recording);

  /// Share of the signals that the scaling makes all the same: those below rest - span, and those more than
  /// a quarter of the span above rest.
  double clipped(const Scaling& scaling) const;
  /// The rig's scaling where it clips no more than a twentieth and the signals fill a tenth of it; otherwise
  /// rest is the level that one signal in 200 exceeds, and span reaches from there to the level that one in
  /// 200 stays below, and a tenth further.
  Scaling fitted() const;
  /// "68 to 102.3", all but the outermost 200th on both sides.
  std::string text() const;

 private:
  double level(double share) const;
  std::vector<float> sorted_;
};

}  // namespace supertac
