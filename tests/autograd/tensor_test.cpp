#include "autograd/tensor.h"

#include <thread>

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::tensor_test {

TEST(Shape, TextAndElements) {
  EXPECT_EQ((Shape{4, 16, 16, 32}).text(), "[4,16,16,32]");
  EXPECT_EQ((Shape{4, 16, 16, 32}).elements(), 32768);
  EXPECT_EQ(Shape().text(), "[]");
  EXPECT_EQ(Shape().elements(), 1);
  EXPECT_EQ((Shape{3, 0, 5}).elements(), 0);
  EXPECT_NE((Shape{2, 3}), (Shape{2, 3, 1}));
}

TEST(Shape, RefusesWhatNoTensorCanHave) {
  EXPECT_REFUSAL("Shape: dims expects at most 4, got 5", Shape{1, 1, 1, 1, 1});
  EXPECT_REFUSAL("Shape: dimension 1 expects 0 or more, and a product of 2^40 or less, got -1", Shape{2, -1});
  EXPECT_REFUSAL("Shape: dimension 1 expects 0 or more, and a product of 2^40 or less, got 2097152",
                 Shape{1 << 20, 1 << 21});
  EXPECT_REFUSAL(
      "Shape: dimension 1 expects 0 or more, and a product of 2^40 or less, got 9223372036854775807",
      Shape{2, INT64_MAX});
}

TEST(Tensor, CopyIsAHandleCloneIsACopy) {
  Tensor a = Tensor::of({2, 2}, {1, 2, 3, 4});
  Tensor handle = a, copy = a.clone();
  a.data()[0] = 9;
  EXPECT_EQ(handle.data()[0], 9);
  EXPECT_EQ(copy.data()[0], 1);
  EXPECT_EQ(handle.data(), a.data());
}

TEST(Tensor, MoveLeavesNothingBehind) {
  Tensor a = Tensor::full({3}, 2);
  const Tensor b = std::move(a);
  EXPECT_FALSE(a.defined());  // NOLINT(bugprone-use-after-move): the state after a move is what is tested
  EXPECT_EQ(a.size(), 0);
  EXPECT_VALUES(b, {3}, {2, 2, 2});
  Tensor c = b;
  Tensor& same = c;
  c = same;  // to itself
  EXPECT_VALUES(c, {3}, {2, 2, 2});
}

TEST(Tensor, ValuesAreAlignedForVectors) {
  for (const Dim size : {1, 3, 17, 1000}) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(Tensor(Shape{size}).data()) % 64, 0U);
  }
}

TEST(Tensor, MayOutliveTheThreadThatMadeItOrEndInAnother) {
  for (int i = 0; i < 50; ++i) {
    Tensor t = Tensor::full({1000}, 1);
    std::thread([moved = std::move(t)]() mutable { moved = Tensor(); }).join();
  }
  Tensor made_elsewhere;
  std::thread([&] { made_elsewhere = Tensor::full({3}, 5); }).join();
  EXPECT_VALUES(made_elsewhere, {3}, {5, 5, 5});
}

TEST(Tensor, EmptyAndUndefinedAreHarmless) {
  const Tensor empty = Tensor::zeros({0, 4});
  EXPECT_TRUE(empty.defined());
  EXPECT_EQ(empty.values().size(), 0U);
  EXPECT_EQ(empty.clone().shape().text(), "[0,4]");
  const Tensor undefined;
  EXPECT_FALSE(undefined.clone().defined());
}

TEST(Tensor, RefusesWrongCounts) {
  EXPECT_REFUSAL("Tensor::of: values expects 4 numbers for [2,2], got 3", Tensor::of({2, 2}, {1, 2, 3}));
  EXPECT_REFUSAL("Tensor::item: this expects one element, got [2]", Tensor::zeros({2}).item());
  EXPECT_EQ(Tensor::full({1, 1}, 7).item(), 7);
}

}  // namespace supertac::tensor_test
