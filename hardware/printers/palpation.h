// One palpation run: onset, slide, release, re-position, pass after pass, as a state machine. Every way is
// checked before the first contact, every boundary between two phases is verified, and whatever happens in
// contact the finger is lifted before the run gives up - unless nothing may be sent any more.
#pragma once

#include <exception>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "hardware/printers/printer.h"

namespace supertac {

/// Of a run: down to the first pass, into contact, along the plate, out of contact, on to the next pass.
enum class Phase { approach, onset, slide, release, reposition };
const char* name_of(Phase phase);

/// Lengths in mm, speeds in mm/s, printer coordinates.
struct PalpationPlan {
  Point3 start = rig::kStart;  ///< of the first slide, in contact
  int passes = rig::kPasses;
  double slide = rig::kSlideMm;        ///< along +y
  double shift_x = rig::kPassShiftMm;  ///< between passes
  double lift = rig::kLiftMm;
  double speed = rig::kSlideMmS;  ///< of the slide
  bool operator==(const PalpationPlan&) const = default;
};

/// A printer's bed is a file, as a sensor is one: where the plate lies, where the head waits, how it slides.
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

/// One straight part of a run.
struct Leg {
  int pass = 0;  ///< from 1
  Phase phase = Phase::approach;
  Point3 from, to;
  double speed = 0;
  double accepted_s = 0;  ///< the firmware's ok to the move
  double ended_s = 0;     ///< the firmware's ok to M400
  double sent_s = 0;      ///< before the move was sent: until then the head stood at `from`
  double behind_s = 0;    ///< ordered for the legs of the plan behind this one
};

/// The leg's length over its speed (s).
double ordered_s(const Leg& leg);
/// The same for all that is left of a plan, with the head at `at` in the leg `now`.
double seconds_left(const Leg& now, const Point3& at);

/// Whether the head can have come from the one sample to the other at this speed (mm/s); how long the answers
/// took and their rounding allowed for, and 5 % for the printer's clock.
bool reachable(double speed, const PositionSample& from, const PositionSample& to);

/// What a run tells while it runs. `check` may throw: the operator's Ctrl-C, a board that is gone, a full
/// disk. `contact` is called with true before the finger may touch, with false when it no longer can, or when
/// nothing can be done.
struct PalpationObserver {
  std::function<void(const Leg&)> leg_started = [](const Leg&) {};
  std::function<void(const Leg&)> leg_ended = [](const Leg&) {};
  std::function<void(const Leg&, const PositionSample&)> position = [](const Leg&, const PositionSample&) {};
  std::function<void()> check = [] {};
  std::function<void(bool)> contact = [](bool) {};
};

/// How a run ended.
struct PalpationOutcome {
  enum class Finger { lifted, stopped, unknown };
  int passes_done = 0;
  bool complete = false;
  Finger finger = Finger::lifted;
  std::string note;          ///< how it ended, when not complete
  std::exception_ptr error;  ///< why, when not complete
};

/// All legs of the plan, from `here` and back (at lifting height or above). Palpation adds some short ones in
/// the air where a firmware has no M114 R. Throws std::invalid_argument for a plan that makes no sense.
std::vector<Leg> legs_of(const PalpationPlan& plan, const Point3& here);
/// The same; throws OutsideLimits, too, where a target or the way to it is not allowed.
std::vector<Leg> legs_within(const Limits& limits, const PalpationPlan& plan, const Point3& here);
/// How long a bed's plan takes as ordered (s).
double planned_s(const Bed& bed);

/// One run of a plan with a printer whose origin is known. Throws OutsideLimits or std::invalid_argument, and
/// as MarlinLink::command() while a homed printer is asked for its limits, before anything moves; after that
/// every failure is in the outcome.
PalpationOutcome run_palpation(Printer& printer, const PalpationPlan& plan,
                               const PalpationObserver& observer = {});

}  // namespace supertac
