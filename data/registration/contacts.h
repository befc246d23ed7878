#pragma once

#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

/// An element of the texture passing over a taxel: a dip of its voltage. Signals of another sensor are taken
/// as the rig's volts that say the same (SignalScale::in), the mean over a taxel's channels.
struct Contact {
  int taxel = 0;
  double time_s = 0;   ///< middle of the dip at half its depth, which survives saturation
  double depth_v = 0;  ///< prominence: from the deepest point up to the higher of the dip's two rims
};

/// The contacts of all taxels, by taxel and time. Rims are sought within reach_s to either side (about 0.6
/// pitches); dips shallower than 8 mV, or than a tenth of the taxel's deepest one, are noise. Frames that
/// hold no finite number are skipped; a taxel that never moves has none. Throws std::invalid_argument when
/// the recording's arrays do not fit together.
std::vector<Contact> find_contacts(const Recording& recording, double reach_s = 0.5);

}  // namespace supertac
