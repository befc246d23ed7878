#include "data/windows/track_card.h"

#include <cmath>

namespace supertac {
namespace {

// A finger that is pressed as deep as rigs press it is clear of the plate when it is lifted by so much more
// than the highest element.
constexpr double kClearanceMm = 1.5;

bool is_reliable(const Recording& recording) {
  const auto flag = recording.metadata.find("registration_reliable");
  return flag == recording.metadata.end() || flag->second != "no";
}

FrameRange::Kind kind_of(const Track& track, std::size_t frame, double clear_mm) {
  const float lift = track.lift_mm[frame];
  if (!std::isfinite(track.position_mm[2 * frame]) || !std::isfinite(track.position_mm[2 * frame + 1]))
    return FrameRange::no_position;
  return lift > kLiftedMm && lift < clear_mm ? FrameRange::lifting : FrameRange::usable;
}

}  // namespace

TrackCard card_of(const Recording& recording, const Track& track, const Plate& plate) {
  TrackCard card{.plate = recording.plate,
                 .source = recording.source,
                 .trial = recording.trial,
                 .pass = recording.pass,
                 .reliable = is_reliable(recording),
                 .speed_mm_s = recording.speed_mm_s,
                 .filter_s = recording.filter_s(),
                 .frames = track.frames(),
                 .held = track.held,
                 .gaps = track.gaps,
                 .damaged = track.damaged,
                 .stretches = {}};
  const double clear_mm = plate.max_height() + kClearanceMm;
  for (std::size_t frame = 0; frame < track.frames(); ++frame) {
    const std::uint32_t kind = kind_of(track, frame, clear_mm), run = track.run[frame];
    if (frame == 0 || run == 1 || kind != card.stretches.back().kind)
      card.stretches.push_back({kind, static_cast<std::uint32_t>(frame), 0, run});
    ++card.stretches.back().frames;
  }
  return card;
}

}  // namespace supertac
