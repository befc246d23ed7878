#include "data/windows/transforms/augment.h"

#include <gtest/gtest.h>

#include <set>
#include <utility>
#include <vector>

#include "tests/expect_error.h"

namespace supertac {
namespace {

std::vector<float> mirrored(const Mirroring& mirroring) {
  std::vector<float> frames = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};  // two of 2 x 3
  mirror(mirroring, frames, 2, 3);
  return frames;
}

TEST(Mirror, ReversesColumnsAndRowsOfEveryFrame) {
  EXPECT_EQ(mirrored({}), (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
  EXPECT_EQ(mirrored({.along_x = true}), (std::vector<float>{3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10}));
  EXPECT_EQ(mirrored({.along_y = true}), (std::vector<float>{4, 5, 6, 1, 2, 3, 10, 11, 12, 7, 8, 9}));
  EXPECT_EQ(mirrored({.along_x = true, .along_y = true}),
            (std::vector<float>{6, 5, 4, 3, 2, 1, 12, 11, 10, 9, 8, 7}));
  std::vector<float> five(5);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { mirror({}, five, 2, 3); }),
            "mirror: expected frames of 2x3, got 5 values");
}

TEST(Mirror, IsDrawnFromSeedAndSample) {
  std::set<std::pair<bool, bool>> seen;
  for (std::uint64_t sample = 0; sample < 40; ++sample) {
    const Mirroring a = Mirroring::drawn(3, sample), b = Mirroring::drawn(3, sample);
    EXPECT_EQ(a.along_x, b.along_x);
    EXPECT_EQ(a.along_y, b.along_y);
    seen.emplace(a.along_x, a.along_y);
  }
  EXPECT_EQ(seen.size(), 4U);
}

}  // namespace
}  // namespace supertac
