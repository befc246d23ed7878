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

// FIPS 180-4's examples and NIST's million letters.
TEST(Sha256, KnownAnswers) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, PartsOfAnySizeGiveTheSame) {
  const std::string text(300, 'x');
  for (std::size_t part = 1; part < 140; ++part) {
    Sha256 sum;
    for (std::size_t at = 0; at < text.size(); at += part) sum.add(std::string_view(text).substr(at, part));
    EXPECT_EQ(sum.hex(), sha256(text)) << part;
  }
}

}  // namespace supertac::hash_test
