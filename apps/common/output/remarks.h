#pragma once

#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// Declares --strict.
void declare_strict(Arguments& a);
/// Says each remark on the data once, on stderr. Throws std::runtime_error with them when --strict is given.
void remark(const Arguments& a, const std::vector<std::string>& remarks);

}  // namespace supertac
