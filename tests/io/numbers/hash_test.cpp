#include "io/numbers/hash.h"

#include "tests/support/test.h"

namespace supertac::hash_test {

std::uint32_t sum_of(std::string_view text, std::uint32_t seed = 0) {
  return crc32(std::as_bytes(std::span(text)), seed);
}

TEST(Crc32, KnownSums) {
  EXPECT_EQ(sum_of(""), 0u);
  EXPECT_EQ(sum_of("a"), 0xE8B7BE43u);
  EXPECT_EQ(sum_of("123456789"), 0xCBF43926u);
  EXPECT_EQ(sum_of("The quick brown fox jumps over the lazy dog"), 0x414FA339u);
}

TEST(Crc32, PartsGiveTheSumOfTheWhole) {
  const std::string_view text = "The quick brown fox jumps over the lazy dog";
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    EXPECT_EQ(sum_of(text.substr(cut), sum_of(text.substr(0, cut))), 0x414FA339u);
  }
}

TEST(Hash, MixGivesTheFirstNumbersOfSplitMix64) {  // of seed 0
  EXPECT_EQ(mix64(kGolden64), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(mix64(2 * kGolden64), 0x6e789e6aa1b965f4ULL);
}

TEST(Hash, HexHasAllSixteenDigits) { EXPECT_EQ(Hash(0x0123456789abcdefULL).hex(), "0123456789abcdef"); }

}  // namespace supertac::hash_test
