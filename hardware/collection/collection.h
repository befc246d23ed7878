// From the journal of a collection to passes with a position for every frame. A pure function of the journal:
// the same capture gives the same passes, byte for byte, today and on replay.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/clock/frame_clock.h"
#include "data/frames/sensor_decoder.h"
#include "data/sensors/sensor.h"
#include "hardware/collection/journal.h"
#include "hardware/collection/position_track.h"
#include "hardware/printers/palpation.h"

namespace supertac {

/// What the recorder writes as events, and the converter reads back.
std::string event_text(const Leg& leg, bool ended);
std::string event_text(const PositionSample& sample);
constexpr const char* kRunComplete = "complete";

/// Onset, slide and release of one pass. Times start at the onset; the middle of each frame counts.
struct CollectedPass {
  int pass = 0;
  double speed = 0;                   ///< ordered
  double measured_speed = 0;          ///< of the slide; 0: nothing tells
  bool complete = false;              ///< the release was verified
  std::vector<double> time_s;         ///< n
  std::vector<float> signals;         ///< n x array.signals(), a frame together, in the sensor's unit
  std::vector<double> position;       ///< n x 3, printer coordinates of the head (mm)
  std::vector<std::uint8_t> suspect;  ///< n; 1: may be torn, or an implausible jump
  std::uint64_t missing = 0;          ///< frames that did not arrive between the first and the last
  /// Frames that did arrive, but whose place among lost ones is uncertain by more than kTrustedMm: after the
  /// host or the board stood still. They are in the journal only.
  std::uint64_t left_out = 0;
  std::uint64_t positions = 0, rejected_positions = 0;
  std::string doubt;  ///< why positions may be wrong by more than kTrustedMm; empty: they are not
};

/// What a recording is named by: the measured speed, to three digits, where it is another than the ordered
/// one.
double named_speed(double measured, double ordered);

/// A position that may be further off is said to be doubtful: a tenth of a taxel's pitch.
constexpr double kTrustedMm = 0.3;

struct Collection {
  std::string header;
  Sensor sensor;  ///< as the header says; the rig's where it says nothing
  Bed bed;
  bool complete = false;
  std::uint64_t torn_bytes = 0;  ///< of the journal's end
  std::uint64_t lost_bytes = 0;  ///< of the journal, damaged
  double lost_s = 0;
  SensorDecoder::Counters decoder;
  std::uint64_t frames = 0, missing = 0, resets = 0;
  FrameTimeline clock;  ///< without its dates
  std::vector<CollectedPass> passes;
};

/// The sensor that a journal's header names; the rig where it names none. Throws JournalError where it is
/// none.
Sensor sensor_of(const Journal& journal);

/// Throws JournalError where the header's "sensor" or "bed" is none.
Collection collection_of(const Journal& journal);

}  // namespace supertac
