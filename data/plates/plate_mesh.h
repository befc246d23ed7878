#pragma once

#include <vector>

#include "data/plates/plate.h"
#include "data/plates/stl.h"

namespace supertac {

struct MeshSettings {
  double resolution_mm = 0.125;  ///< distance of the points of the textured part, where heights are exact
  double base_mm = 3;            ///< of material below the lowest point
};

/// The plate as a solid to print, in its own coordinates: textured top, four walls, flat bottom. Closed and
/// manifold (every edge belongs to two triangles, in opposite directions), outside by the right-hand rule.
/// Between two points the surface is straight; lines along x are placed on every crest and where the texture
/// begins and ends, so that peaks keep their height. A plate that was read from STL and is written at the
/// spacing of its grid (HeightMap::kCellMm) is the same plate when it is read again. A texture that varies
/// along y only has no points between its sides. Throws std::invalid_argument unless 0.02 <= resolution <= 5
/// and 0.2 <= base <= 100 mm.
std::vector<Triangle> mesh_of(const Plate& plate, const MeshSettings& settings = {});

}  // namespace supertac
