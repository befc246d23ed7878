// What must hold for the STL reader on any bytes.
#pragma once

#include <cmath>
#include <span>
#include <stdexcept>

#include "data/plates/stl.h"
#include "io/files/file.h"

namespace supertac {

/// Any bytes are triangles with usable coordinates, at most one for every 50 bytes, or a FileError; and the
/// triangles are a height map without NaN, or a FileError. Throws std::logic_error otherwise.
inline void check_stl(std::span<const std::byte> input) {
  try {
    const auto triangles = parse_stl(input, "fuzz.stl");
    if (triangles.empty() || triangles.size() > input.size() / 50)
      throw std::logic_error("stl: more triangles than the file has room for");
    for (const Triangle& triangle : triangles)
      for (const auto& corner : triangle)
        for (const float value : corner)
          if (!(std::abs(value) <= kMaxStlCoordinateMm))
            throw std::logic_error("stl: an unusable coordinate was accepted");
    const HeightMap map(triangles, "fuzz.stl");
    if (!(map.extent().min_height <= map.extent().max_height)) throw std::logic_error("height map: NaN");
    if (!std::isfinite(map(18, 54))) throw std::logic_error("height map: NaN");
  } catch (const FileError&) {
  }
}

}  // namespace supertac
