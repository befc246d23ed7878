#pragma once

#include <string>

#include "apps/common/arguments.h"
#include "hardware/collection.h"

namespace supertac {

/// The journal's header line: what is needed to make recordings of it later.
std::string collection_header(const std::string& plate, int trial, double speed);
std::string journal_path(const std::string& folder, const std::string& plate, int trial, double speed);

/// Turns a journal into one recording per pass in `folder`, with a line of quality each. A pass that was cut
/// off is marked incomplete in its metadata. The same journal gives the same bytes.
/// @returns frames written
/// @throws JournalError, FileError
int write_passes(const Arguments& arguments, const std::string& journal, const std::string& folder);

}  // namespace supertac
