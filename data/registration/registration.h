#pragma once

#include <string>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"

namespace supertac {

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

/// Where, from the centre along y, a row of taxels (0 trailing) feels an element best. The rig's rows do so
/// nearer together than they lie, for its pad is round; those of another sensor, of the same array too, where
/// they are.
double row_contact_mm(const Recording& recording, std::size_t row);

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

}  // namespace supertac
