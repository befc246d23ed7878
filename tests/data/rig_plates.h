// The eight plates of the rig.
#pragma once

namespace supertac {

inline constexpr const char* kRigPlates[] = {"3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges",
                                             "4_Waves", "6_Waves", "4_Blob",   "6_Blob"};

}  // namespace supertac
