#pragma once

#include "apps/common/command_line/program.h"

namespace supertac {

/// The kernels chosen on this processor; warns where fused multiply-add is done in software.
Numerics numerics();

}  // namespace supertac
