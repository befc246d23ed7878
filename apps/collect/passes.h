// From the journal of a collection to a recording for each pass.
#pragma once

#include <string>

#include "apps/common/command_line/arguments.h"
#include "apps/common/output/output_folder.h"
#include "hardware/collection/collection.h"

namespace supertac {

/// The journal's header line: what is needed to make recordings of it later. Sensor and bed are left out
/// where they are the rig's.
std::string collection_header(const std::string& plate, int trial, double speed, const Sensor& sensor,
                              const Bed& bed);
std::string journal_path(const std::string& folder, const std::string& plate, int trial, double speed);

/// What a journal held, for the reader and for --json.
struct PassesReport {
  std::size_t frames = 0;    ///< in the recordings
  std::size_t left_out = 0;  ///< frames whose time is uncertain
  std::size_t undated = 0;   ///< passes without a recording: the time of all their frames is uncertain
  std::size_t doubtful = 0;  ///< passes whose positions may be wrong
  bool complete = false;     ///< the run ended as planned
  std::uint64_t resets = 0;  ///< of the sensor, by its stamps
  std::string damage = {};   ///< of the journal, in words; empty: none
  nlohmann::ordered_json json = {};
  /// "N frames" and what `became` of them, with what is to be said of doubtful passes and damage: the end of
  /// the last line.
  std::string total(const std::string& became = {}) const;
};

/// Turns the journal at `path` into one recording per pass in `folder`, with a line of quality each, and the
/// plate's STL file, when it has one, from beside the journal. A pass that was cut off is marked incomplete
/// in its metadata. The same journal gives the same bytes. Throws JournalError, FileError.
PassesReport write_passes(const Arguments& arguments, const std::string& path, OutputFolder& folder);

}  // namespace supertac
