// A whole collection against two ports - captured bytes, journal events, board and palpation run together -,
// and from its journal to passes with a position for every frame. The latter is a pure function of the
// journal: the same capture gives the same passes, byte for byte, whenever it is read.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/clock/frame_clock.h"
#include "data/frames/sensor_decoder.h"
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

// Where the head was during a pass, and how fast: fitted to what the printer measured, never to what was
// ordered. The order says where a leg begins and ends; speed and times are the machine's.

/// How the moves of a run took their time where the firmware has no M114 R, measured by the run itself with
/// short moves at the slide's speed v and at a slow one. A move of length L at speed v ends delay + L / v +
/// ramps(v) after the firmware's ok. Two speeds tell the delay from the ramps but for what lies between ramps
/// in proportion to v (an acceleration) and none at the slow speed (a jerk): `range_s`.
struct MoveTiming {
  double delay_s = 0;         ///< of the start
  double acceleration = 500;  ///< mm/s^2, of ramps that take the measured time
  double slowness = 1;        ///< of slides; measured from three on and within 2 %
  double spread_s = 0;        ///< how far the measurements lie apart
  double range_s = 0;  ///< by which delay_s may be wrong, the ramps then being so much shorter or longer
  double faster = 1;   ///< than ordered, at most, by the positions of any leg
};
/// From the short moves in the air that Palpation makes; in their absence from all legs, as if at 500 mm/s^2.
MoveTiming timing_of(std::span<const Leg> ended);
/// Of the leg's middle part (mm/s), by its positions; 0: too few.
double fitted_speed(const Leg& leg, const std::vector<PositionSample>& samples);

/// Where the head was, from the polled positions of one pass. The speed of a leg is the median of its
/// samples' own. The longest chain of samples is kept in which each can be reached from the one before at the
/// ordered speed times MoveTiming::faster; the others were damaged, late, or misdated while the host stood
/// still. Between samples the position is linear in time, outside of begin() to end() that of the nearer one.
class PositionTrack {
 public:
  /// Adds a leg's samples; without samples the leg is modelled as a trapezoid of speed that begins by
  /// `timing` and ends when M400 was answered.
  void add_leg(const Leg& leg, const std::vector<PositionSample>& samples, const MoveTiming& timing);
  struct Knot {
    double time_s;
    Point3 position;
    double doubt_mm = 0;  ///< how far the head may have been from there, and on the way to it
  };
  Knot at(double time_s) const;
  double begin() const { return points_.empty() ? 0 : points_.front().time_s; }
  double end() const { return points_.empty() ? 0 : points_.back().time_s; }
  std::uint64_t rejected() const { return rejected_; }
  /// Of the slide, as measured (mm/s); 0: nothing tells.
  double speed() const { return speed_; }
  /// Why, and by how much, at() or speed() may be wrong; each ends with "; ". Empty: by less than
  /// `trusted_mm`.
  std::string doubt(double trusted_mm) const;

 private:
  void add(double time_s, const Point3& position);
  void model(const Leg& leg, const MoveTiming& timing);
  void distrust(double fastest, const PositionSample& before, const PositionSample& after);
  std::vector<Knot> points_;
  std::uint64_t rejected_ = 0;
  double speed_ = 0;
  double doubt_mm_ = 0;    // how far at() may be from the head
  double misfits_ = 0;     // the largest share of a leg's samples that fit no way of the head
  double unevenness_ = 0;  // of the slide's speed, relative
};

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
  Sensor sensor;  ///< as the journal's header says; the rig's where it says nothing
  Bed bed;
  bool complete = false;
  FrameTimeline clock;  ///< of all frames, those between the passes too
  std::vector<CollectedPass> passes;
};

/// The sensor that a journal's header names; the rig where it names none. Throws JournalError where it is
/// none.
Sensor sensor_of(const Journal& journal);

/// Throws JournalError where the header's "sensor" or "bed" is none.
Collection collection_of(const Journal& journal);

}  // namespace supertac
