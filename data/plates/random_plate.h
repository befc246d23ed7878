// What a random plate looks like.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "data/plates/surface.h"

namespace supertac {

/// Regular textures, or a surface of its own; neither: a plain plate.
struct DrawnPlate {
  std::vector<Texture> textures = {};
  std::shared_ptr<const Surface> surface = {};
};

/// Kinds, layouts and sizes are drawn from the number alone:
///   plain                                                            1 in 16
///   equal elements in rows (ridges, bumps, blobs, waves), or two such textures one behind the other
///   lines with a pitch of their own each, some oblique; single lines; scattered round elements; smooth hills
/// Pitches 4 to 15 mm, heights .5 to 3 mm; more than half of the lines and rounds have the size of the rig's.
DrawnPlate draw_plate(std::uint32_t number);

}  // namespace supertac
