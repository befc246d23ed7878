#pragma once

#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>

#include "data/clock/frame_clock.h"
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

}  // namespace supertac
