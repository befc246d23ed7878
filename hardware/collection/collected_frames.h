// All frames of a journal, decoded and dated on the clock that the printer's positions have.
#pragma once

#include <cstdint>
#include <vector>

#include "data/clock/frame_clock.h"
#include "data/frames/sensor_decoder.h"
#include "data/sensors/sensor.h"
#include "hardware/collection/journal.h"

namespace supertac {

struct CollectedFrames {
  std::vector<float> signals;         ///< n x array.signals(), as Sensor::arrange()
  FrameTimeline clock;                ///< dates: n, when the sensor had finished each
  std::vector<std::uint8_t> suspect;  ///< n; 1: may be torn, or an implausible jump
  SensorDecoder::Counters decoder;

  std::size_t size() const { return clock.dates.size(); }
};

/// Any sensor, by timeline_of().
CollectedFrames frames_in(const Journal& journal, const Sensor& sensor);

}  // namespace supertac
