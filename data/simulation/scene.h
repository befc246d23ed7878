// What presses an array: objects with outlines, lowered onto it, moved and lifted.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/body.h"
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

 private:
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
  static Contact draw(int kind, const Objects& objects, const TaxelArray& array, const RandomStream& random,
                      std::uint64_t first);
  static std::vector<Wave> draw_waves(double size, double pitch, double length, const RandomStream& random,
                                      std::uint64_t first);
  static std::vector<double> heights(const Contact& contact, double x0_mm, double y0_mm, const Field& field);
  static double inside_mm(const Contact& contact, double x_mm, double y_mm);

  std::vector<Contact> contacts_;
};

}  // namespace supertac
