// One picture of the whole surface that was felt, made of all pictures of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/sensors/taxel_array.h"

namespace supertac {

/// A rectangle of a map's cells. Cell (i, j) is centred at x = (i + 1/2) p, y = (j + 1/2) q on the plate,
/// with (p, q) = pixel_mm of the pictures.
struct MapRegion {
  std::int64_t left = 0, bottom = 0, width = 0, height = 0;

  bool empty() const { return width <= 0 || height <= 0; }
  bool holds(const MapRegion& other) const;
  /// The least rectangle around both.
  MapRegion with(const MapRegion& other) const;
};

/// What a map says of a region, [height][width], row 0 at its smallest y; NaN where nothing was felt.
struct MapCells {
  MapRegion region;
  std::vector<float> values, errors;  ///< errors: as SurfaceMap::add() takes them; empty where there are none
};

/// A window knows more of a point the longer the point has been under the array, so a point is drawn worst
/// when it is drawn first. The map fuses pictures k = 1, 2 ... of a cell:
///   value = sum w v / sum w,    error = sum w e / sum w,    w = (d + 1 um) exp(s / lambda) / e
/// v, e: the picture and its error, at least 0.01, at the cell's centre, by Catmull-Rom and by linear
/// interpolation (Keys 1981). d: way of the finger (mm) since the picture before, at most a pixel, so that a
/// finger that stands counts once. s: way since the cell came under the array, at most the side of the
/// picture L = sqrt(width height), so that what leaves the array last counts most; a cell that is touched
/// again begins anew, and visits count alike. lambda = L / 4 and the power of e were fitted on trial 1 with
/// passes held out (docs/map.md). A step of more than half a side is a jump: it is no way, and all cells
/// begin anew.
///
/// The weighted mean is the best linear unbiased estimate of a value from observations whose errors have
/// variances 1 / w (Aitken 1935). The errors of overlapping pictures are nearly the same, so they are
/// averaged and not divided by the number of pictures.
///
/// Causal: what cells() gives between two pictures uses no later one. Smoothed: the same when all have come.
/// The same pictures in the same order give the same bits. One object serves one thread.
class SurfaceMap {
 public:
  /// Pictures of this grid. `grows`: whether later windows know more of a point; not of networks of single
  /// frames, all of whose pictures count alike (lambda is infinite).
  explicit SurfaceMap(const ImageGrid& grid, bool grows = true);

  /// A picture [height][width] whose centre lies at (x_mm, y_mm), and the predicted error of each pixel
  /// (empty: not known, and then never). A place that is not finite is left out. Throws std::invalid_argument
  /// when a size is wrong, std::runtime_error when the map would have more than kMostCells, or a place lies
  /// so far away that it is no mm.
  void add(double x_mm, double y_mm, std::span<const float> picture, std::span<const float> errors);
  /// The picture around (x_mm, y_mm) that the map has, [height][width], by Catmull-Rom interpolation; beside
  /// what was never felt linear between felt cells, and NaN where there are none. `picture` has the size of
  /// grid(), unchecked.
  void read(double x_mm, double y_mm, std::span<float> picture) const;

  /// Around everything that was felt; around the newest picture.
  const MapRegion& felt() const { return felt_; }
  const MapRegion& newest() const { return newest_; }
  MapCells cells(const MapRegion& region) const;
  const ImageGrid& grid() const { return grid_; }
  bool empty() const { return pictures_ == 0; }

  static constexpr std::int64_t kMostCells = 1 << 24;

 private:
  struct Cell {
    double weight = 0, value = 0, error = 0, growth = 0;  // sums of w, w v and w e; exp(s / lambda)
    std::uint64_t seen = 0;                               // number of the newest picture of it
  };
  double step(double x_mm, double y_mm);
  void make_room(const MapRegion& region);
  std::size_t index(std::int64_t i, std::int64_t j) const {
    return static_cast<std::size_t>((j - stored_.bottom) * stored_.width + i - stored_.left);
  }
  const Cell* felt_cell(std::int64_t i, std::int64_t j) const;

  ImageGrid grid_;
  bool grows_, has_errors_ = false;
  double side_mm_, most_growth_;
  MapRegion stored_, felt_, newest_;
  std::vector<Cell> cells_;                  // of stored_
  std::uint64_t pictures_ = 0, number_ = 0;  // how many; of the newest, two more behind a jump
  double x_mm_ = 0, y_mm_ = 0;               // of the newest
};

}  // namespace supertac
