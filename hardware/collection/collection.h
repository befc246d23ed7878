// From the journal of a collection to passes with a position for every frame. A pure function of the journal:
// the same capture gives the same passes, byte for byte, today and on replay.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/frames/frame_decoder.h"
#include "data/sensors/sensor.h"
#include "hardware/boards/frame_clock.h"
#include "hardware/collection/journal.h"
#include "hardware/printers/bed.h"

namespace supertac {

/// What the recorder writes as events, and the converter reads back.
std::string event_text(const Leg& leg, bool ended);
std::string event_text(const PositionSample& sample);
constexpr const char* kRunComplete = "complete";

constexpr double kModelledMmS2 = 500;  ///< acceleration of moves that are modelled

/// How the moves of a run took their time where the firmware has no M114 R, measured by the run itself: a
/// move ends `delay_s` + `slowness` * length / speed + speed / kModelledMmS2 after the firmware's ok to it.
struct MoveTiming {
  double delay_s = 0;   ///< of the start; another acceleration than the modelled one is in it
  double slowness = 1;  ///< of slides; measured from three on and within 2 %
  double spread_s = 0;  ///< how far the measurements of delay_s lie apart
};
/// From the short moves in the air that Palpation makes at the slide's speed; in their absence from all legs.
MoveTiming timing_of(std::span<const Leg> ended);

/// Where the head was, from the polled positions of one pass. Of the samples the longest chain is kept in
/// which each can be reached from the one before; the others were damaged, late, or misdated while the host
/// stood still. Between samples the position is linear in time.
class PositionTrack {
 public:
  /// Adds a leg's samples; without samples the leg is modelled as a trapezoid of speed that begins by
  /// `timing` and ends when M400 was answered.
  void add_leg(const Leg& leg, const std::vector<PositionSample>& samples, const MoveTiming& timing);
  Point3 at(double time_s) const;
  double begin() const { return points_.empty() ? 0 : points_.front().time_s; }
  double end() const { return points_.empty() ? 0 : points_.back().time_s; }
  std::uint64_t rejected() const { return rejected_; }
  /// How far (mm) at() may be from the head: between two samples, or where a modelled leg did not take its
  /// time.
  double doubt_mm() const { return doubt_mm_; }

 private:
  struct Knot {
    double time_s;
    Point3 position;
  };
  void add(double time_s, const Point3& position);
  void model(const Leg& leg, const MoveTiming& timing);
  void distrust(const Leg& leg);
  std::vector<Knot> points_;
  std::uint64_t rejected_ = 0;
  double doubt_mm_ = 0;
};

/// Onset, slide and release of one pass. Times start at the onset; the middle of each frame counts.
struct CollectedPass {
  int pass = 0;
  double speed = 0;
  bool complete = false;              ///< the release was verified
  std::vector<double> time_s;         ///< n
  std::vector<float> volts;           ///< n x array.signals(), a frame together, in the sensor's unit
  std::vector<double> position;       ///< n x 3, printer coordinates of the head (mm)
  std::vector<std::uint8_t> suspect;  ///< n; 1: may be torn, or an implausible jump
  std::uint64_t missing = 0;          ///< frames that did not arrive between the first and the last
  /// Frames that did arrive, but whose place among lost ones is uncertain by more than kTrustedMm: after the
  /// host or the board stood still. They are in the journal only.
  std::uint64_t left_out = 0;
  std::uint64_t positions = 0, rejected_positions = 0;
  std::string doubt;  ///< why positions may be wrong by more than kTrustedMm; empty: they are not
};

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
  FrameDecoder::Counters decoder;
  std::uint64_t frames = 0, missing = 0;
  ClockFit clock;
  std::vector<CollectedPass> passes;
};

/// The sensor that a journal's header names; the rig where it names none. Throws JournalError where it is
/// none.
Sensor sensor_of(const Journal& journal);

/// Throws JournalError where the header's "sensor" or "bed" is none.
Collection collection_of(const Journal& journal);

}  // namespace supertac
