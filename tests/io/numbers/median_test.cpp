#include "io/numbers/median.h"

#include "tests/support/test.h"

namespace supertac::median_test {

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  EXPECT_EQ(median(std::vector{5}), 5);
  EXPECT_EQ(median(std::vector{9, 1, 2}), 2);
  EXPECT_EQ(median(std::vector{9, 1, 7, 2}), 7);
  std::vector<double> numbers{3, 3, -1, 8, 0};
  EXPECT_EQ(median(numbers), 3);
}

}  // namespace supertac::median_test
