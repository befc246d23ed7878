// A whole collection against two ports: captured bytes, journal events, board and palpation run together.
// What supertac-collect does, without its output.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "data/sensors/sensor.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/collection/journal.h"
#include "hardware/printers/palpation.h"

namespace supertac {

struct RecorderSettings {
  Bed bed;        ///< the plan, and where the operator confirms the head to be
  Sensor sensor;  ///< what the head carries
  ReaderSettings reader;
  bool home = false;    ///< home instead
  std::string journal;  ///< path; must not exist
  std::string header;   ///< one line that says what is collected
  /// True: lift the finger and end, by OperatorStop. Asked for every 0.02 s from the first moment on.
  std::function<bool()> stop = [] { return false; };
  /// Called with true before the finger may touch, with false when it no longer can.
  std::function<void(bool)> contact = [](bool) {};
  /// Called for every polled position; for a live line.
  std::function<void(const Leg&, const Point3&, const ReaderCounters&)> progress;
};

struct RecorderReport {
  PalpationOutcome outcome;
  std::string kept;  ///< of the printer's state, as this run has set it
};

/// Runs the plan and journals everything, in at most three times the plan's time and five minutes. Throws
/// while nothing has been recorded - no device, the wrong one, a plan outside the limits, a homing that
/// failed - and then leaves no journal; later failures are in the outcome. When this returns the journal is
/// complete on disk, or outcome.error says why not. `board` is the sensor's port, which must be live.
RecorderReport record_palpation(std::unique_ptr<Port> board, std::unique_ptr<Port> printer,
                                const RecorderSettings& settings);

}  // namespace supertac
