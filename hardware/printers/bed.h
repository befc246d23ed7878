// A printer's bed is a file, as a sensor is one: where the plate lies, where the head waits, how it slides.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "hardware/printers/palpation.h"

namespace supertac {

/// In the printer's coordinates; by default the rig's.
struct Bed {
  Point3 origin = rig::kMounted;  ///< where the head waits before and after a run
  Limits limits = {};             ///< with the plate's place
  PalpationPlan plan = {};
  unsigned baud = rig::kPrinterBaud;

  bool operator==(const Bed&) const = default;
};

/// Throws FileError that names the key, what was expected and found.
Bed read_bed(const std::string& path);
/// The same from text; `where` names it in messages.
Bed bed_of_json(const std::string& text, const std::string& where);
nlohmann::ordered_json json_of(const Bed& bed);

}  // namespace supertac
