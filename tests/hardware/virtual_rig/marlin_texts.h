// What real Marlin (bugfix-2.0.x) says at length: its boot banner, and its answer to M115.
#pragma once

#include <string>

namespace supertac {

/// 28 lines, the first of them "start".
std::string marlin_banner();

/// About 30 lines: the firmware's name and its capabilities.
std::string marlin_capabilities(bool emergency_parser);

}  // namespace supertac
