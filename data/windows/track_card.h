// What a recording says of its windows without its arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/recordings/resample.h"

namespace supertac {

/// Lifted further than this, a finger is in the air: a height that is measured is never quite that of the
/// slide.
inline constexpr double kLiftedMm = 0.1;

/// Frames that follow each other without a gap, and all end windows or all end none.
struct FrameRange {
  enum Kind : std::uint32_t { usable, no_position, lifting };  ///< as in WindowCounts
  std::uint32_t kind = usable;
  std::uint32_t first = 0, frames = 0;  ///< of the track
  std::uint32_t run = 1;                ///< that of its first frame, as in Track
};

struct TrackCard {
  std::string plate, source;
  int trial = 0, pass = 0;
  bool reliable = true;  ///< as registration says
  double speed_mm_s = 0, filter_s = 0;
  std::size_t frames = 0, held = 0, gaps = 0, damaged = 0;  ///< as in Track
  std::vector<FrameRange> stretches;                        ///< of all frames, in their order
};

/// Of a recording over this plate, and what resample() made of it.
TrackCard card_of(const Recording& recording, const Track& track, const Plate& plate);

}  // namespace supertac
