// One seeded pulling of a plug, through the kernel's pseudo-terminals: when it was noticed, and where the
// finger was left.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

namespace supertac {

enum class Plug { board, printer };

struct UnplugVerdict {
  double moment_s = 0;  ///< of the collection or of the idle reading, when the plug was pulled
  /// From the pull to the typed error; of the board in a collection: to the stop sent to the printer.
  double noticed_s = 0;
  double returned_s = 0;    ///< from the pull to the end of the collection, finger lifted, journal on disk
  double stall_s = 0;       ///< for which the machine itself stood still between pull and error; allowed for
  double hanging_up_s = 0;  ///< that the kernel took to hang the terminal up; allowed for
  std::string finger;       ///< what the outcome says
  std::string broken;       ///< the promise that was broken; empty when all held

  /// How late the notice itself was, which depends on what else the machine does.
  double late_s() const { return noticed_s - std::max(stall_s, hanging_up_s); }
};

/// Pulls the plug of a port that is only read from.
UnplugVerdict unplug_idle(Plug plug, std::uint64_t seed);

/// Pulls it at a random moment of a short collection. Promises: a typed error; with the printer still there
/// the finger ends lifted, without it the note says to lift it by hand.
UnplugVerdict unplug_in_collection(Plug plug, std::uint64_t seed);

}  // namespace supertac
