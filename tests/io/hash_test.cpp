#include "io/hash.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

TEST(Hash, MixGivesTheFirstNumbersOfSplitMix64) {  // of seed 0
  EXPECT_EQ(mix64(kGolden64), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(mix64(2 * kGolden64), 0x6e789e6aa1b965f4ULL);
}

TEST(Hash, HexHasAllSixteenDigits) { EXPECT_EQ(hex64(0x0123456789abcdefULL), "0123456789abcdef"); }

}  // namespace
}  // namespace supertac
