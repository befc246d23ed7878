#pragma once

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "io/images/images.h"

namespace supertac {

inline constexpr double kPictureFromMm = 20, kPictureToMm = 88;  ///< of the plate's y

/// How well a registered pass fits its plate, to be judged at a glance: over the plate's y from
/// kPictureFromMm to kPictureToMm the plate's height (top band) and below it the signals of the 16 taxels,
/// row 3 (leading) first, each drawn where its row feels contact: at the finger's y plus row_contact_mm(row).
/// In a pass that fits, the bright patches of all rows stand under the plate's elements; off by a pitch, a
/// row of patches is missing at one end; a wrong rate slants them. Each taxel is scaled by its own deepest
/// dip; where nothing is known it is white. Throws std::invalid_argument when the recording has no positions
/// or is not of the rig's array.
Picture registration_picture(const Recording& recording, const Plate& plate);

}  // namespace supertac
