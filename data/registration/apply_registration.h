#pragma once

#include "data/recordings/recording.h"
#include "data/registration/registration.h"

namespace supertac {

/// Writes what a registration says into its recording.
/// position_mm: x as given, y from the registration, limited to the plate; NaN outside
/// valid_from_s..valid_until_s. time_s: from lost_at_s on later by lost_s. The gap is filled with frames on a
/// straight line between the signals before and behind it, position unknown; where either side has nothing,
/// or a frame at most would fit, it is left open. Stamps that were only nominal (metadata time_base) are then
/// stretched so that the finger of a reliable pass moves at its commanded speed (10 mm/s where that is
/// unknown); time_base becomes "registered". Metadata registration_start_mm, _rate, _residual_mm, _reliable
/// (yes, no), _reason, _shift_mm, _stretch_mm and _lost_s.
void apply(const Registration& registration, Recording& recording, double x_mm = rig::kPlateWidthMm / 2);

}  // namespace supertac
