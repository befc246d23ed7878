#include "io/numbers/numbers.h"

#include <clocale>

#include "io/numbers/median.h"
#include "io/numbers/parallel.h"
#include "io/numbers/text.h"
#include "tests/support/test.h"

namespace supertac::numbers_numbers_test {

TEST(Numbers, ParseTakesTheWholeText) {
  EXPECT_EQ(parse_double("2.3887939453125"), 2.3887939453125);
  EXPECT_EQ(parse_double("-1e-3"), -0.001);
  EXPECT_TRUE(std::isnan(parse_double("nan").value()));
  for (const char* text : {"", " 1", "1 ", "+1", "1,5", "2.12.3", "0x10", "1e999", "one", "1e"}) {
    EXPECT_FALSE(parse_double(text)) << text;
  }
  EXPECT_EQ(parse_int("-9223372036854775808"), std::numeric_limits<std::int64_t>::min());
  for (const char* text : {"", "9223372036854775808", "1.0", "1x", "-"})
    EXPECT_FALSE(parse_int(text)) << text;
  EXPECT_EQ(parse_uint("18446744073709551615"), std::numeric_limits<std::uint64_t>::max());
  for (const char* text : {"-1", "18446744073709551616"}) EXPECT_FALSE(parse_uint(text)) << text;
}

TEST(Numbers, FormatReadsBackAsTheSame) {
  for (const double value : {0.1, 1.0 / 3, 1e300, -5e-324, 10.0})
    EXPECT_EQ(parse_double(format(value)), value);
  EXPECT_EQ(format(10.0), "10");
  EXPECT_EQ(format(0.1f), "0.1");
  EXPECT_EQ(format(2.345, 1), "2.3");
  EXPECT_EQ(format(-1e308, 2).size(), 313u);
}

TEST(Numbers, IgnoreTheLocale) {
  for (const char* name : {"de_DE.UTF-8", "C"}) {  // where it is not installed the first changes nothing
    std::setlocale(LC_ALL, name);
    EXPECT_EQ(format(0.5), "0.5");
    EXPECT_EQ(parse_double("0.5"), 0.5);
  }
}

TEST(Text, ForeignTextCannotBreakALine) {
  EXPECT_EQ(in_quotes("a\nb\x1b[31m\xff"), "'a?b?[31m?'");
  EXPECT_EQ(in_quotes(std::string(100, 'x')), "'" + std::string(60, 'x') + "...'");
}

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  EXPECT_EQ(median(std::vector{5}), 5);
  EXPECT_EQ(median(std::vector{9, 1, 2}), 2);
  EXPECT_EQ(median(std::vector{9, 1, 7, 2}), 7);
  std::vector<double> numbers{3, 3, -1, 8, 0};
  EXPECT_EQ(median(numbers), 3);
}

TEST(ParallelFor, RunsAllAndThrowsWhatTheFirstOneThrew) {
  std::vector<int> ran(1000);
  parallel_for(ran.size(), [&](std::size_t i) { ++ran[i]; });
  EXPECT_EQ(ran, std::vector<int>(1000, 1));
  try {
    parallel_for(ran.size(), [&](std::size_t i) {
      ++ran[i];
      if (i % 7 == 3) throw std::runtime_error(std::to_string(i));
    });
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "3");
  }
  EXPECT_EQ(ran, std::vector<int>(1000, 2));
  parallel_for(0, [](std::size_t) { FAIL(); });
}

}  // namespace supertac::numbers_numbers_test
