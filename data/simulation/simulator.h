// The rig's finger, or that of another array, slides over a plate: what its taxels would show.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "io/numbers/random.h"

namespace supertac {

/// What the simulated sensor does to the scene, and how strongly. Defaults resemble the rig's recordings;
/// docs/import.md shows what each term changes.
struct SimulatorSettings {
  TaxelArray array;  ///< of one channel or three axes; gains and pad are the rig's whatever the array
  double rate_hz = 300;
  double indentation_mm = 0.2;  ///< how far the slide's path lies below first contact with the flat plate
  double volts_per_load = 0.9;  ///< drop of a taxel of gain 1 per unit load; load = mean indentation (mm)
  double wander = 0;            ///< how much the finger rocks on its way, see simulate_pass()
  double threshold_mm = 0;      ///< |N(0, 1)| times this is the load of which a taxel feels nothing

  /// The finger gives way: a bump under one row lifts the other rows. Cubic mm of indented pad per mm, of a
  /// flat body as large as the rig's pad.
  double mount_stiffness = 15;
  /// A dome touches an element before a taxel is above it; the skin blurs as sigma_mm() says, and is the
  /// rig's where none is known.
  Body body = Body::of_rig();
  bool with_edges = true;      ///< beside the plate there is nothing to touch
  double tilt_spread = 0.01;   ///< the finger's rear rows ride lower
  bool with_gains = true;      ///< taxels differ: the outer columns feel most
  bool with_variation = true;  ///< gain and indentation differ from trial to trial and pass to pass
  double gain_spread = 0.4, indentation_spread_mm = 0.5;
  double vibration_mm = 0.01, vibration_hz = 28;  ///< of the printer, in z
  double drift_volts_per_s = 4e-4;                ///< of the rest voltages
  double emi_volts = 1e-3, emi_hz = 50;           ///< mains
  double noise_volts = 1e-3;

  bool with_adc = true;             ///< the board's converter
  double filter_s = rig::kFilterS;  ///< moving average of the board
  bool with_saturation = true;      ///< recordings are cut to what the published ones were
  double jitter_s = 2e-4;           ///< a sample is taken a little off the time it is stamped with
  double lost_fraction = 0.002;
};

/// Where the finger's centre is; z_mm = 0 is first contact with the flat plate, negative is pressed.
struct FingerPose {
  double x_mm = 0, y_mm = 0, z_mm = 0;
  double slope_x = 0, slope_y = 0;  ///< added to the mounting's tilt, in mm per mm: the pad is higher there
};

/// One pass, as palpation programs move: onset (the finger comes down from rig::kLiftMm), sliding along +y,
/// release (it lifts), re-position (it moves back and on, in the air, to where the next pass begins).
struct PassSettings {
  int trial = 1;
  int pass = 1;  ///< pass p slides at x = rig::pass_x_mm(p), from one side of the plate to the other
  double speed_mm_s = rig::kSlideMmS;
  double from_mm = 0, to_mm = rig::kPlateLengthMm;  ///< the slide, of the finger's centre
};

/// Weights of places for the columns or rows of taxels, [lines][places]: a bell, averaged over a taxel's
/// side, each line of which sums to 1; and the same times how many sigmas the place lies from the line, which
/// sums to a load's lean.
struct TaxelWeights {
  std::vector<double> load, lean;

  TaxelWeights() = default;
  /// Lengths in mm: lines `pitch` apart, places `step` apart from `first` on, from the array's centre.
  TaxelWeights(int lines, double pitch, int places, double first, double step, double bell, double sigma,
               double taxel = 0);
};

/// The sum of what presses the places, weighted for each taxel [rows][columns] of an array: place (i, j)
/// across and along is pressed[i * across_step + j * along_step], 0 or more.
std::vector<double> taxel_loads(const TaxelArray& array, std::span<const double> pressed,
                                std::size_t across_step, std::size_t along_step,
                                const std::vector<double>& across_weights,
                                const std::vector<double>& along_weights);

/// The finger's voltages over a plate, one per taxel: contact of an elastic pad on a yielding mount, then the
/// sensor. A pure function of pose and time, used alike by the simulator and by the virtual rig. Lengths,
/// indentations and loads are in mm, slopes in mm per mm, times in s, signals in V; stiffness is in mm^2.
///
/// A point u of the pad, 2 mm apart across and 0.25 mm along the slide and up to 3.5 and 6.5 mm beyond the
/// outermost taxels, is indented by
///   d(u) = max(0, plate(x + u_x, y + u_y) - body.depth_mm(u) - slope u - z - lift)   (mm, lowest point of
///   the pad as it is mounted at 0),
/// the mount yields until stiffness * lift = integral of d, and taxel k feels the mean of d around it:
///   load_k = sum_u w(u - u_k) d(u),  w a bell of standard deviation body.sigma_mm(), sum 1,
///   V_k = rest_k - volts_per_load * gain_k * max(0, load_k - threshold_k) + disturbances.
/// A taxel of three axes (x, y, z) has this for z. A skin whose magnets or markers move leans away from where
/// it is pressed, and is dragged along the slide: x and y lie in the middle of the range and have, for the
/// load,
///   lean_x = sum_u w(u - u_k) (u - u_k)_x / sigma d(u)   and   lean_y - 0.3 load_k;
/// not fitted to any sensor.
/// Radius, sigma, stiffness, slope and the linear law were fitted to the rig's recordings (docs/import.md).
class FingerModel {
 public:
  /// The same pass (its trial, number and speed) and seed give the same gains, depth and noise. Throws
  /// std::invalid_argument for an array out of range or of other than one or three channels.
  FingerModel(const Plate& plate, const SimulatorSettings& settings, const PassSettings& pass = {},
              std::uint64_t seed = 1);

  /// Voltages [taxels,channels] before ADC, filter and saturation.
  std::vector<double> volts(const FingerPose& pose, double time_s) const;

  /// This pass's path height during the slide: minus the indentation. Positive when the finger rides above
  /// the flat plate and touches only the texture.
  double slide_z_mm() const { return -indentation_mm_; }

 private:
  double surface(double x_mm, double y_mm) const;
  std::vector<double> indented(const FingerPose& pose) const;  // d(u), [across][along]
  void shape_pad(double slope_x, double slope_y);

  SimulatorSettings settings_;
  RandomStream noise_;
  std::vector<double> gain_, threshold_, rest_, drift_;  // per taxel
  double indentation_mm_ = 0, vibration_phase_ = 0, emi_phase_ = 0;
  std::vector<double> map_;                      // surface on a grid, x fastest
  std::vector<double> rise_;                     // of the pad's points above its lowest, [across][along]
  int across_ = 0, along_ = 0;                   // the pad's points across and along the slide
  TaxelWeights across_weights_, along_weights_;  // of columns and rows
};

/// A recording of one pass as the rig would make it, with the finger's true position at every time stamp.
/// The position is where the finger is; the moving average makes the signals trail it by 49 ms, as on the
/// rig. With SimulatorSettings::wander = w the finger rocks on its way: its slopes across and along are
/// w n(y), its height is 4 mm w n(y), each with an n of its own: a sum of smooth noises 40, 20, ... 1.25 mm
/// long whose variances halve, of deviation 0.85. Deterministic in (plate, pass, settings, seed).
/// Throws std::invalid_argument on speeds, rates or paths that make no pass, and as FingerModel.
Recording simulate_pass(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings = {},
                        std::uint64_t seed = 1);

}  // namespace supertac
