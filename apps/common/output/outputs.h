// Every file that a program is told to write, looked at in one place before the work begins.
#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// Throws UsageError when two of the outputs are one file (by inode, or by name where they do not exist yet),
/// or an output is one of the inputs or lies among them; FileError when one cannot be written where it shall
/// be.
void check_outputs(const Arguments& arguments);

/// Opens /dev/null where descriptors 0 to 2 are closed: a port opened later would otherwise get one of these
/// numbers, and a message would be sent to the device behind it.
void open_standard_descriptors();

}  // namespace supertac
