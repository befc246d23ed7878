#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// What --list-ports prints: a serial port a line, the tactile board marked.
void print_ports(const Arguments& arguments);

}  // namespace supertac
