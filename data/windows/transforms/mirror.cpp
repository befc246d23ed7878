#include "data/windows/transforms/mirror.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "io/numbers/random.h"

namespace supertac {

Mirroring Mirroring::drawn(std::uint64_t seed, std::uint64_t sample) {
  constexpr std::uint64_t kMirrorStream = 0x6d6972ULL << 40;  // keeps clear of the streams other code uses
  const std::uint32_t bits = RandomStream(seed, kMirrorStream ^ sample).bits(0);
  return {.along_x = (bits & 1) != 0, .along_y = (bits & 2) != 0};
}

void mirror(const Mirroring& mirroring, std::span<float> frames, std::size_t rows, std::size_t columns) {
  if (rows * columns == 0 || frames.size() % (rows * columns) != 0)
    throw std::invalid_argument("mirror: expected frames of " + std::to_string(rows) + "x" +
                                std::to_string(columns) + ", got " + std::to_string(frames.size()) +
                                " values");
  for (; !frames.empty(); frames = frames.subspan(rows * columns)) {
    float* frame = frames.data();
    if (mirroring.along_x)
      for (std::size_t row = 0; row < rows; ++row)
        std::reverse(frame + row * columns, frame + (row + 1) * columns);
    if (mirroring.along_y)
      for (std::size_t row = 0; row < rows / 2; ++row)
        std::swap_ranges(frame + row * columns, frame + (row + 1) * columns,
                         frame + (rows - 1 - row) * columns);
  }
}

}  // namespace supertac
