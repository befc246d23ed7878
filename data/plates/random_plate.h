#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "data/plates/plate.h"

namespace supertac {

/// The plate called "random<number>": what networks for unseen plates are trained and tested on. Kinds,
/// layouts and sizes are drawn from the number alone:
///   plain                                                            1 in 16
///   equal elements in rows (ridges, bumps, blobs, waves), or two such textures one behind the other
///   lines with a pitch of their own each, some oblique; single lines; scattered round elements; smooth hills
/// Pitches 4 to 15 mm, heights .5 to 3 mm; more than half of the lines and rounds have the size of the rig's.
Plate random_plate(std::uint32_t number);

/// The number in "random<number>"; empty for any other text.
std::optional<std::uint32_t> random_plate_number(std::string_view name);

/// True when both have a texture of the same kind whose pitches differ by less than half a millimetre: a
/// network that is trained on one has seen the other.
bool resemble(const Plate& a, const Plate& b);

}  // namespace supertac
