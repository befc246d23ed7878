#include "io/numbers/parallel.h"

#include "tests/support/test.h"

namespace supertac::parallel_test {

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

}  // namespace supertac::parallel_test
