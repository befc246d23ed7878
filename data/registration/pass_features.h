// What the signals of a pass show by themselves, without its plate: contacts, and where frames were lost.
#pragma once

#include <vector>

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
/// pitches); dips shallower than 8 mV, or than a tenth of the taxel's deepest one, are noise; a taxel
/// that never moves has none. Throws std::invalid_argument when the recording's times do not increase, or
/// span more than 10,000 s.
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

}  // namespace supertac
