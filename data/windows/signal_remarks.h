// Faults of a data set that no single file shows.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"

namespace supertac {

/// Remarks on these windows, for people: no signal changes, some never do (less than a fiftieth of
/// what the middle one does: dead taxels), a twentieth or more lie at the end of the scaling (saturated or
/// clipped), no truth shows anything. Looks at some thousand of them, evenly spread; nothing when all is
/// well.
std::vector<std::string> remarks_on(const WindowSet& windows, std::span<const std::uint32_t> chosen);

}  // namespace supertac
