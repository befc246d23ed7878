// Where the finger was in a real pass: what its signals show by themselves, contacts and lost frames, how its
// contacts are laid onto the elements of the plate, and the passes of one plate onto each other.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"

namespace supertac {

/// An element of the texture passing over a taxel: a dip of its voltage. Signals of another sensor are taken
/// as the rig's volts that say the same (SignalScale::in), the mean over a taxel's channels.
struct Contact {
  int taxel = 0;
  double time_s = 0;   ///< middle of the dip at half its depth, which survives saturation
  double depth_v = 0;  ///< prominence: from the deepest point up to the higher of the dip's two rims
};

/// The contacts of all taxels, by taxel and time. Rims are sought within reach_s to either side (about 0.6
/// pitches); dips shallower than 8 mV, or than a tenth of the taxel's deepest one, are noise; a taxel that
/// never moves has none, nor has a recording of fewer than three frames. Throws std::invalid_argument when
/// the recording's last time is not later than its first, or later by more than 10,000 s.
std::vector<Contact> find_contacts(const Recording& recording, double reach_s = 0.5);

/// Frames that a host lost without a trace, found in the signals. n numbers: how many are missing between
/// frame i - 1 and frame i, beyond those that its time stamps show; a fraction where the signals stand still.
///
/// Behind the board's moving average signals are smooth: around frame i each of them takes about the same
/// step u_s from frame to frame (the median of 81). Where k frames are missing, all take k + 1 of these steps
/// at once:
///   k + 1 = sum_s w_s d_s u_s / sum_s w_s u_s^2,   w_s = 1 / (deviation of s's steps from u_s)^2,
/// d_s the steps found there, with an uncertainty of 1 / sqrt(sum_s w_s u_s^2). It counts when it is
/// above 1.5 by three of them. Where the signals stand still (uncertainty above a quarter) the mean of all
/// other places is assumed.
std::vector<double> find_lost_frames(const Recording& recording, double rate_hz);

/// Puts the time of lost frames back into the stamps of a recording made at rate_hz. Metadata lost_frames
/// says how many there were.
void restore_clock(Recording& recording, double rate_hz);

struct Stretch {
  double begin_s = 0, end_s = 0;
};

/// The recording cut at its bursts of lost frames, at least one stretch: where the signals of all taxels
/// change from one frame to the next by 0.08 V in sum and by 60 times what is usual in the 80 frames around.
/// A moving average does not jump. Throws nothing; the recording must have a frame.
std::vector<Stretch> stretches_of(const Recording& recording);

/// Where the finger was during a pass: y(t) = start_mm + rate * t for the recording's own clock t, with the
/// time of lost frames put back.
struct Registration {
  double start_mm = 0;      ///< y of the finger's centre at time 0
  double rate = 0;          ///< mm per second of the recording's clock
  double residual = 0;      ///< rms distance (mm) of the contacts used from where their element should be
  int contacts = 0;         ///< used for the fit
  int elements = 0;         ///< of the texture that they belong to
  double matched = 0;       ///< share of all contacts, by weight, that agree with the plate
  double coverage = 0;      ///< share of the (taxel row, element) pairs in reach that were felt
  double margin = 0;        ///< by how much the score beats the next best start, a pitch off for example
  double valid_from_s = 0;  ///< the stretch that was fitted: a recording is cut at bursts of lost frames
  double valid_until_s = 0;
  bool reliable = false;
  std::string reason = {};  ///< what is wrong when it is not
  double shift_mm = 0;      ///< align_passes() moved it by so much at y = 54 mm, ...
  double stretch_mm = 0;    ///< ... by so much more at y = 80 mm, ...
  double lost_at_s = 0;     ///< ... found that from here on the clock is ...
  double lost_s = 0;        ///< ... slow by so much (frames lost where nothing moved), ...
  double agreement = 0;  ///< ... after which its signals correlate so with the other passes'; 0: not aligned

  /// Where the finger was at the recording's time t.
  double y_mm(double t) const { return start_mm + rate * (t + (t >= lost_at_s ? lost_s : 0)); }
};

/// Fits start and rate of a pass to its plate. Each element of the texture that passes a taxel row makes a
/// contact (find_contacts); the fit is the line that puts the contacts of all rows onto the plate's elements:
///   y(time of contact) + row offset = crest of the element.
/// All starts and rates within reach are tried, scored by the contacts that agree and the elements that were
/// felt (so a fit that is one pitch off loses the elements at one end), the best is refined by robust least
/// squares. Where a burst of frames was lost (a jump that the moving average makes impossible), only the
/// stretch with most contacts is used. Row offsets are symmetric about the finger's centre, so an outline
/// that is felt early by the leading rows and late by the trailing ones does not move the centre. The delay
/// of the recording's moving average (metadata filter_s) is taken out.
/// Any array and sensor will do whose rows lie across the slide, which goes towards larger y.
/// Never throws for a pass that does not fit: it is flagged. Throws std::invalid_argument as find_contacts
/// does.
Registration register_pass(const Recording& recording, const Plate& plate);

/// Sets reliable and reason. Not reliable is a fit with fewer than 8 contacts or 3 elements, less than 0.4
/// matched or 0.3 covered, a residual above 0.55 mm, a margin below 0.03: chosen on the rig's 96 passes; or
/// one of the following. The stated speed against the fitted rate: a clock that counts lines ("time_base"
/// nominal) may be slow by 5 % and twice the share of frames seen to be lost, and fast by 3 %; any other
/// clock is right to 5 %. Frames lost over more than the texture's length; a moving average over more than
/// half the least distance of two elements.
void judge(Registration& registration, const Recording& recording, const Plate& plate);

/// Writes what a registration says into its recording.
/// position_mm: x as given, y from the registration, limited to the plate; NaN outside
/// valid_from_s..valid_until_s. time_s: from lost_at_s on later by lost_s. The gap is filled with frames on a
/// straight line between the signals before and behind it, position unknown; where either side has nothing,
/// or a frame at most would fit, it is left open. Stamps that were only nominal (metadata time_base) are then
/// stretched so that the finger of a reliable pass moves at its commanded speed (10 mm/s where that is
/// unknown); time_base becomes "registered". Metadata registration_start_mm, _rate, _residual_mm, _reliable
/// (yes, no), _reason, _shift_mm, _stretch_mm and _lost_s.
void apply(const Registration& registration, Recording& recording, double x_mm = rig::kPlateWidthMm / 2);

/// A pass and where its own registration puts it.
struct RegisteredPass {
  const Recording* recording = nullptr;
  Registration* registration = nullptr;
};

/// Aligns the passes of one plate with each other. A registration knows its pass by a few dozen contacts; the
/// whole course of the signals, beside that of the other passes over the same texture, tells its place
/// better.
///
/// Each pass is a profile p_r(y): how far the four taxels of row r are pressed on average within 1 mm of y,
/// for y = 22..92 mm. Its line is changed by a shift a and a stretch b (mm),
///   y' = y + a + b (y - 54) / 26,
/// for the largest
///   mean over r of corr(p_r, mean of the other passes' p_r) - 0.002 ((a / 0.5)^2 + b^2),
/// six rounds over all passes. The medians of a and b over the passes are subtracted in each round, so that
/// the plate as a whole stays where the registrations put it.
///
/// A pass that agrees badly (correlation of 0.5 to 0.9) is tried with frames lost at one place: 0.1 to 0.8 s,
/// at every 0.2 s. Where the signals stand still such a loss leaves no step for find_lost_frames() to see. It
/// is accepted when the correlation rises by 0.05, and all passes are aligned once more.
///
/// Passes that are not reliable take no part; with fewer than three nothing changes, nor does a pass whose
/// correlation stays below a half. Sets start_mm, rate, shift_mm, stretch_mm, lost_at_s, lost_s and agreement
/// (the correlation). It uses no truth, split or network. Throws std::invalid_argument when a recording is
/// not of the rig's array.
void align_passes(std::span<const RegisteredPass> passes);

}  // namespace supertac
