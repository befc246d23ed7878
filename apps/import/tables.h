// Tables of a sensor's frames, one a pass, as a folder of recordings.
#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// Counts and names a file that is no recording under --skip-bad. Throws std::runtime_error without it.
void leave_out(const Arguments& arguments, const FileError& error, std::size_t& left_out);

/// Declares --sensor and what belongs to it.
void declare_tables(Arguments& arguments);

/// `input` is a table or a folder of them (*.csv, *.txt, *.tsv, *.npy, in folders one below it, whose names
/// become the group). Throws FileError, UsageError.
int import_tables(const Arguments& arguments, const std::string& input);

}  // namespace supertac
