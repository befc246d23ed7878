// One picture of a stream, and what a view shows of the stream at one moment.
#pragma once

#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/stream/pressed_order.h"
#include "data/clock/frame_clock.h"
#include "data/map/named_map.h"
#include "data/sensors/taxel_array.h"

namespace supertac {

/// What the pictures of a stream hold; without pixels there are none, only signals.
struct PictureFormat {
  std::size_t signals = 0;  ///< in a frame
  ImageGrid image;
  bool half_widths = false, distance = false;  ///< whether the model says how sure it is
  const char* tensor = "volts";                ///< that holds the signals (signals_tensor)
};

/// One picture of a stream and what belongs to it, valid until the next.
struct LiveFrame {
  std::uint64_t number = 0;  ///< from 0, the row of a picture log of the whole stream
  double time_s = 0;         ///< since the stream's first frame
  double wall_s = NAN;  ///< time_s on the wall clock as it was at first (s since 1970); NaN where a recording
                        ///< does not say
  std::span<const float> signals, picture;
  std::span<const float> half_widths;  ///< of each pixel's 90 % interval; empty when the model does not say
  std::optional<FrameArrival> arrival = {};  ///< of a board's frame
  std::optional<double> distance;  ///< of its window from those of training (models/inference/novelty.h)
};

inline double mean_of(std::span<const float> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// A signal that has changed.
struct ChangedSignal {
  int taxel = 0, channel = 0;
  double rest = 0, now = 0;  ///< in the sensor's unit
};

struct LiveState {
  std::uint64_t number = 0;  ///< of the picture, as LiveFrame
  double time_s = 0;
  std::vector<float> taxels;  ///< [rows][columns] in [0,1], as RawArray; empty before the first
  double top = 0;             ///< what 1 is, in the sensor's unit from rest
  std::optional<ChangedSignal> most_changed;
  PressedOrder::Status order = {};
  std::vector<float> picture;      ///< [rows * scale][columns * scale]; empty before the first
  std::vector<float> half_widths;  ///< the same, as LiveFrame
  std::optional<double> distance;
  bool unlike_training = false;     ///< the signals are not such as the model has learnt from
  float x_mm = NAN, y_mm = NAN;     ///< of the finger's centre on the plate, where known
  MapCells map;                     ///< what has changed of the surface that was felt; empty: nothing
  std::optional<NamedMap> surface;  ///< all of it, once a second
  double frames_per_s = 0;
  double median_ms = 0, p99_ms = 0;  ///< latency
  std::uint64_t lost = 0, dropped = 0;

  /// Mean of half_widths; 0 when unknown.
  double uncertainty() const { return half_widths.empty() ? 0 : mean_of(half_widths); }
};

/// Its figures on a terminal: rate, latency, frames lost and dropped, how sure the model is and where the
/// finger is.
std::string status_line(const LiveState& state);

}  // namespace supertac
