// What a view shows of a stream at one moment.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/stream/live_frame.h"
#include "apps/stream/pressed_order.h"
#include "data/map/map_file.h"

namespace supertac {

/// A signal that has changed.
struct ChangedSignal {
  int taxel = 0, channel = 0;
  double rest = 0, now = 0;  ///< in the sensor's unit
};

struct LiveState {
  TaxelArray array;
  int scale = 4;             ///< of the picture
  std::uint64_t number = 0;  ///< of the picture, as LiveFrame
  double time_s = 0;
  std::vector<float> taxels;  ///< [rows][columns] in [0,1], as RawArray; empty before the first
  double top = 0;             ///< what 1 is, in the sensor's unit from rest
  std::string unit = {};      ///< of top
  std::optional<ChangedSignal> most_changed;
  PressedOrder::Status order = {};
  bool draws = true;               ///< there is a model
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
