// How an array is built: what a touch goes through on its way to the signals.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/taxel_array.h"

namespace supertac {

class JsonObject;

enum class BodyShape { flat, dome, cylinder };

/// A body; by default flat, under a skin that nobody has measured. Loads are shares: 1 presses a taxel hard.
struct Body {
  BodyShape shape = BodyShape::flat;
  double radius_mm = 0;  ///< of a dome, or of a cylinder whose axis lies along the columns
  /// Of the elastic cover. A point that presses it is felt as a bell of standard deviation skin_mm / 2, as
  /// wide at half its height as the pressure under an elastic half-space (Boussinesq). 0: not known.
  double skin_mm = 0;
  double taxel_mm = 0;  ///< side of the square that a taxel is the mean over; 0: a point
  /// A load l shows as l (1 + k) / (l + k): half of what it can show at most at l = k, as a resistor that is
  /// pressed shows in a voltage divider. 0: as l, a linear response.
  double knee = 0;
  /// Of a passive matrix: the share of the mean of its row (of its column) that a taxel shows besides.
  double crosstalk_rows = 0, crosstalk_columns = 0;
  double hysteresis_s = 0;  ///< what is let go comes back with this time constant; what is pressed, at once
  double creep = 0, creep_s = 0;  ///< a load that stays grows by the share `creep` with this time constant
  double noise = 0;               ///< standard deviation of a signal at rest, as a share of the range
  /// Standard deviation of what was found by a fit, by its key: simulations vary it so far.
  std::map<std::string, double> uncertainty = {};

  /// The rig's finger: a dome of 47 mm, whose skin was fitted with its taxels in it (docs/import.md).
  static Body of_rig();
  /// That of a recording or sensor which does not say it: the rig's for its array, else flat.
  static Body usual(const TaxelArray& array);
  /// How far the surface lies behind its foremost point, (x, y) from the array's centre (mm).
  double depth_mm(double x_mm, double y_mm) const;
  /// Standard deviation in mm of the bell under a point that presses: skin and taxel.
  double sigma_mm() const;
  /// Throws std::invalid_argument where a member is out of its range, with its key in the file.
  void check() const;
  bool operator==(const Body&) const = default;
};

/// The numbers of a body that a fit finds, by their keys.
struct BodyNumber {
  const char* key;
  double Body::*of;
};
std::span<const BodyNumber> fitted_numbers();

/// From the loads of an array, a frame after the other, to what its signals show: hysteresis, creep, response
/// and crosstalk, in this order. Of axes that pull either way the response is odd.
class BodyResponse {
 public:
  BodyResponse(const Body& body, const TaxelArray& array);
  /// Whether it changes anything.
  bool neutral() const;
  /// `shares` [taxels,channels] in place, `period_s` after the frame before; the first is taken to have
  /// stood.
  void operator()(double period_s, std::span<double> shares);

 private:
  Body body_;
  TaxelArray array_;
  std::vector<double> load_, crept_;
};

/// For a sensor's file, a recording's or a model's metadata.
nlohmann::ordered_json json_of(const Body& body);
/// Throws FileError as sensor_of_json().
Body body_of(JsonObject keys);

}  // namespace supertac
