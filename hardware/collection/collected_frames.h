// All frames of a journal, decoded and dated on the clock that the printer's positions have.
#pragma once

#include <cstdint>
#include <vector>

#include "data/frames/frame_decoder.h"
#include "data/sensors/sensor.h"
#include "hardware/boards/frame_clock.h"
#include "hardware/collection/journal.h"

namespace supertac {

struct CollectedFrames {
  std::vector<float> signals;          ///< n x array.signals(), as Sensor::arrange()
  std::vector<double> arrival_s;       ///< n: when the read returned
  std::vector<double> end_s;           ///< n: when the sensor had finished the frame
  std::vector<double> doubt_s;         ///< n: by how much that may be wrong; frames were lost about here
  std::vector<std::uint64_t> missing;  ///< n: frames lost before it, since the first
  std::vector<std::uint8_t> suspect;   ///< n; 1: may be torn, or an implausible jump
  FrameDecoder::Counters decoder;
  std::uint64_t lost = 0;  ///< frames
  ClockFit clock;          ///< period_s: from frame to frame
  int steady = 128;        ///< of so many frames and eight reads one at least was on time
  int follow = 0;          ///< so many frames behind a pass tell whether its last ones were

  std::size_t size() const { return end_s.size(); }
};

/// The rig's board by timeline_of(). Another sensor by FrameReader, as a stream dates it; where it sends time
/// stamps, a line under the arrivals brings its clock to the printer's.
CollectedFrames frames_in(const Journal& journal, const Sensor& sensor);

}  // namespace supertac
