// The rig's text recordings, found in their folder and registered against their plates.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/recordings/imports/imports.h"
#include "data/registration/registration.h"
#include "io/files/file.h"

namespace supertac {

/// A text recording of the rig, and what became of it.
struct ImportedPass {
  std::string path;  ///< of the text file
  Plate plate;
  std::string plate_file;  ///< the STL file that describes the plate; empty when its name does
  Recording recording = {};
  std::size_t lines = 0, dropped = 0;  ///< of the text file; empty ones do not count
  Registration registration = {};

  /// A line for people: lines read and dropped, residual, what alignment changed, reliable or why not.
  std::string summary() const;
  nlohmann::ordered_json to_json() const;
};

struct FolderImport {
  double speed_mm_s = 10;  ///< as commanded, of all passes
  /// Told of every file and folder that is no recording, or of no known plate, trial or pass; it is then left
  /// out. It may throw to end the import, as it does unless it is set.
  std::function<void(const FileError&)> left_out = [](const FileError& error) { throw FileError(error); };
  /// Told before the passes of each plate are read, and before they are aligned, which takes seconds; it may
  /// throw to stop.
  std::function<void(std::size_t done, std::size_t files)> progress = [](std::size_t, std::size_t) {};
};

/// Files, or folders, of a folder by name, hidden ones left out. Throws FileError.
std::vector<std::filesystem::path> entries_of(const std::filesystem::path& folder, bool folders);

/// Imports a folder of the rig's text recordings, `PLATE/TRIAL/PASS.txt` with PLATE a name that
/// Plate::named takes, or `PLATE.stl` beside its folder. The recordings have plate, trial, pass, speed,
/// positions, a clock in seconds and the metadata of apply(); they are in the order of their names.
///
/// The files hold no clock. Steps 1, 2 and 5 write it, and each step needs what the one before left:
///   1. import_text_pass() counts the lines: frame i at i / rig::kFrameRateHz. A dropped line keeps its
///      place.
///   2. restore_clock() puts back the time of frames that the host lost, seen as steps of all signals. A
///      registration fits a straight line through the clock, and through a clock with holes none fits within
///      a millimetre.
///   3. register_pass() finds start and rate against the plate, from this pass alone.
///   4. align_passes() compares the reliable passes of a plate (one that feels the same along every line) and
///      moves them onto each other; so it needs all their registrations. It finds losses of frames where
///      nothing moves, which left no step for 2.
///   5. apply() writes positions, then the losses that 4 found, then stretches the clock to the commanded
///      speed. It is last, since the registrations count by the clock of step 2.
/// Throws FileError when the folder cannot be read, holds no pass, a plate is unknown, a trial or pass is no
/// number, two files are the same pass, or no file is a recording.
/// `take` gets the passes of one plate after the other, so that no more than these are in memory.
void import_text_folder(const std::string& root, const FolderImport& settings,
                        const std::function<void(std::vector<ImportedPass>)>& take);

}  // namespace supertac
