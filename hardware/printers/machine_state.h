// What another job may have left on in a printer, and a run depends on: each state is set before the first
// length is sent, read back where the firmware tells it, and given back at the end. The states are a table,
// in the source: state, how set, how read, what if not.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hardware/printers/marlin_link.h"

namespace supertac {

/// Where the firmware itself cuts moves of a homed machine, without a word.
struct SoftLimits {
  Point3 low, high;
  std::string text;  ///< as it said them
};
/// M211; nothing where they are off or not told.
std::optional<SoftLimits> soft_limits_of(MarlinLink& link);

class MachineState {
 public:
  /// Sets every state that this firmware has; one that it does not know it does not have. Again, it sets them
  /// again (homing switches mesh compensation on) and remembers what it found the first time. `homed`: also
  /// refuses what shifts a homed machine and nothing else. Throws PrinterRefused that names a state which
  /// stays another, and as MarlinLink::command.
  void set(MarlinLink& link, bool homed);

  /// What was changed becomes as it was found, where that was told.
  void put_back(MarlinLink& link);
  /// What stays as it was set, "plane (G17), ...": what the firmware does not tell, or was not put back.
  std::string kept() const;

 private:
  struct Changed {
    std::string name;  // with the command that set it
    std::string back;  // commands; empty: nothing told what it was
  };
  std::vector<Changed> changed_;
};

}  // namespace supertac
