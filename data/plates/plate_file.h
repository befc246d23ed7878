// Plates that come from a file. A recording names its plate; when that is an STL file, the file lies beside
// the recording, so that a folder of recordings holds all that training needs and can be moved.
#pragma once

#include <string>

#include "data/plates/plate.h"

namespace supertac {

/// True for the name of a plate of unknown shape: it begins with "unknown". Its recordings can be streamed
/// and drawn; they have no truth, so nothing can be learnt from them or scored.
bool is_unknown_plate(const std::string& name);

/// The plate that `name` means for recordings of `folder`: one of Plate::named, or an STL file there.
/// Throws std::invalid_argument for an unknown plate, or an STL file named with a folder (a recording must
/// not choose which file is read); FileError when the file is missing or no plate.
Plate plate_in_folder(const std::string& name, const std::string& folder);

/// Puts the STL file `path` into `folder` under its own name, so that plate_in_folder() finds it. Does
/// nothing for a plate that is no file, or when the same bytes are there already.
/// Throws FileError when another plate has that name there.
void keep_plate_file(const std::string& path, const std::string& folder);

}  // namespace supertac
