// What presses an array - objects with outlines, lowered onto it, moved and lifted -, and such presses
// simulated: recordings whose truth is the pressure on its surface.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/recordings/recording.h"
#include "io/numbers/random.h"

namespace supertac {

/// The objects: disc, bar, ring, edge, letter, fingertip, and mixed, each of any of these; and as many kinds
/// of rough surface, as of bodies, feet and cloth: surface1 (grains) to surface7 (hills as large as the
/// array).
const std::vector<std::string>& press_kinds();

/// A surface under an array, in mm from its centre.
struct Field {
  double left_mm, top_mm, cell_x_mm, cell_y_mm;  ///< the centre of the first cell, and from cell to cell
  int rows, columns;
  double x_mm(int column) const { return left_mm + column * cell_x_mm; }
  double y_mm(int row) const { return top_mm + row * cell_y_mm; }
  std::size_t cells() const { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }
};

/// Zero to four contacts of one press, which lasts kSeconds. A contact comes down somewhere over the array or
/// its edges, is loaded, may move and turn, and is lifted. Its outline is hard or soft: the pressure grows
/// from 0 at the outline to that of the press within a tenth of the object's size, or to its middle. A
/// surface is a Gaussian random field whose spectrum is a power law; what lies above a level that is drawn
/// touches, the harder the higher. Drawn from `random` alone.
class Scene {
 public:
  static constexpr double kSeconds = 1.2;
  /// Which objects: of one of press_kinds(), from the smallest (0) to the largest (1).
  struct Objects {
    std::string kind = {};
    double smallest = 0, largest = 1;
  };
  Scene(const Objects& objects, const TaxelArray& array, const RandomStream& random);

  /// Pressure [rows][columns] of `field` at time `t` from 0 to kSeconds: 0 where nothing touches, 1 pressed
  /// hard. A point of a body that lies d mm behind the foremost one under an object is pressed by d / give_mm
  /// less.
  void pressure(double t, const Body& body, double give_mm, const Field& field,
                std::span<double> pressure) const;

  struct Wave {
    double x_per_mm, y_per_mm, phase, height;  // in turns, and standard deviations
  };
  struct Contact {
    int kind = 0;
    double x_mm = 0, y_mm = 0, cosine = 1, sine = 0;  // of the beginning
    double move_x_mm_s = 0, move_y_mm_s = 0;
    double size_mm = 0, other_mm = 0, edge_mm = 0;  // of the outline; how far the pressure takes to grow
    double most = 0, down_s = 0, loaded_s = 0, lifting_s = 0, up_s = 0;
    std::vector<double> shape;  // strokes of a letter
    std::vector<Wave> waves;    // of a surface
  };

 private:
  std::vector<Contact> contacts_;
};

struct Presses {
  std::string kind = "disc";  ///< of press_kinds()
  int number = 1;             ///< of the recording: others of its kind have other scenes
  int count = 100;
  int scale = 4;  ///< truth that many times as fine as the array
};

/// Frames of each press, at random times of it.
constexpr int kFramesOfAPress = 6;

/// `count` presses, one after the other, each with a Scene of its own. With p the scene's pressure, which is
/// the truth (clipped to 1), signal k is
///   load_k   = mean of p over the taxel, under the skin: a bell of Body::sigma_mm() around it
///   signal_k = rest - span (response(load))_k + noise, cut to the range,
/// of the sensor's body (BodyResponse) and scale. Three axes have this for z; x and y lean away from the
/// pressure, as in FingerModel without drag, and rest in the middle of the range unless the file says where.
/// What the body's file does not say is drawn for each press - a skin that spreads by 0.15 to 0.6 pitches,
/// noise of 0.2 to 1 % of the range - and so is what it knows with an uncertainty; every press is up to a
/// quarter weaker or stronger, and every taxel 5 % by itself. Silent taxels are filled as live ones are. The
/// recording has truth, group and plate (the kind) and source "simulated". Deterministic in (sensor, presses,
/// seed), on any processor. Throws std::invalid_argument for an unknown kind, or an array of other than
/// one or three channels.
Recording simulate_presses(const Sensor& sensor, const Presses& presses, std::uint64_t seed);

/// Somebody presses here and there for so long: scenes as of simulate_presses(), of 0.4 to 2.5 s, at the
/// sensor's rate, by objects of a range of sizes that is drawn once: who has thick fingers keeps them. No
/// truth. Deterministic in (sensor, seconds, seed).
Recording simulate_touching(const Sensor& sensor, double seconds, std::uint64_t seed);

}  // namespace supertac
