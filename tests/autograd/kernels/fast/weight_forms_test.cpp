// Forms that are kept must give the bits of those made anew, and must not outlive a change of the weights.
#include "autograd/kernels/fast/weight_forms.h"

#include "autograd/kernels/conv.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "autograd/kernels/sums.h"
#include "autograd/ops/linear.h"
#include "tests/autograd/check.h"

namespace supertac::kernels {
namespace {

using test::numbers;
using test::same_bytes;

ConvSizes map_of(Dim side) {
  return {{.height = side, .width = side, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1},
          5,
          32,
          16};
}

// Each kernel that makes a form: of a map for Winograd, of a smaller one, of a linear layer.
std::vector<Tensor> results(const Tensor& conv_w, const Tensor& linear_w) {
  std::vector<Tensor> all;
  for (const Dim side : {8, 5}) {
    const ConvSizes s = map_of(side);
    const Tensor x = numbers({5, side * side, 32}, 1), gy = numbers({5, side * side, 16}, 2);
    Tensor y(gy.shape()), gx(x.shape());
    conv(s, x.data(), conv_w.data(), nullptr, 1, y.data());
    conv_grad_x(s, gy.data(), conv_w.data(), Into::overwrite, gx.data());
    all.push_back(y), all.push_back(gx);
  }
  const Tensor gy = numbers({3, 40}, 3);
  Tensor gx(Shape{3, 24});
  linear_grad_x(3, 24, 40, gy.data(), linear_w.data(), Into::overwrite, gx.data());
  all.push_back(gx);
  return all;
}

bool same(const std::vector<Tensor>& a, const std::vector<Tensor>& b) {
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!same_bytes(a[i], b[i])) return false;
  return true;
}

TEST(WeightForms, KeptOnesGiveTheSameBitsUntilTheWeightsChange) {
  if (is_plain()) GTEST_SKIP() << "plain kernels make no forms";
  Tensor conv_w = numbers({9, 32, 16}, 4), linear_w = numbers({24, 40}, 5);
  const std::vector<Tensor> before = results(conv_w, linear_w);
  WeightForms forms({conv_w, linear_w});
  {
    const WeightForms::Use use(forms);
    EXPECT_TRUE(same(results(conv_w, linear_w), before));
    EXPECT_TRUE(same(results(conv_w, linear_w), before)) << "the second time they are kept";
  }
  for (Tensor* w : {&conv_w, &linear_w})
    for (real& x : w->values()) x += real(0.5);
  const std::vector<Tensor> after = results(conv_w, linear_w);
  EXPECT_FALSE(same(after, before));
  const WeightForms::Use use(forms);
  EXPECT_FALSE(same(results(conv_w, linear_w), after)) << "nothing was kept";
  forms.renew();
  EXPECT_TRUE(same(results(conv_w, linear_w), after));
}

TEST(WeightForms, OtherWeightsAreNotKept) {
  Tensor conv_w = numbers({9, 32, 16}, 4), linear_w = numbers({24, 40}, 5);
  WeightForms forms({numbers({2, 2})});
  const WeightForms::Use use(forms);
  const std::vector<Tensor> before = results(conv_w, linear_w);
  for (real& x : conv_w.values()) x += real(0.5);
  const std::vector<Tensor> after = results(conv_w, linear_w);
  EXPECT_FALSE(same_bytes(after[1], before[1]));
}

TEST(WeightForms, ThreadsShareThem) {
  if (is_plain()) GTEST_SKIP() << "plain kernels make no forms";
  const Tensor conv_w = numbers({9, 32, 16}, 4), linear_w = numbers({24, 40}, 5);
  const std::vector<Tensor> expected = results(conv_w, linear_w);
  WeightForms forms({conv_w, linear_w});
  int different = 0;
#pragma omp parallel for num_threads(8) reduction(+ : different)
  for (int i = 0; i < 64; ++i) {
    const WeightForms::Use use(forms);
    different += same(results(conv_w, linear_w), expected) ? 0 : 1;
  }
  EXPECT_EQ(different, 0);
}

TEST(AddAsTree, IsTheTreeOfPairs) {
  constexpr Dim kSize = 2500;  // several blocks
  for (std::size_t count = 1; count <= 9; ++count) {
    std::vector<Tensor> parts, tree;
    std::vector<const real*> pointers;
    for (std::size_t i = 0; i < count; ++i) parts.push_back(numbers({kSize}, i + 1));
    for (const Tensor& part : parts) pointers.push_back(part.data()), tree.push_back(part.clone());
    Tensor sum(Shape{kSize});
    add_as_tree(kSize, pointers, sum.data());
    for (std::size_t apart = 1; apart < count; apart *= 2)
      for (std::size_t i = 0; i + apart < count; i += 2 * apart)
        for (Dim k = 0; k < kSize; ++k) tree[i].data()[k] += tree[i + apart].data()[k];
    EXPECT_TRUE(same_bytes(sum, tree[0])) << count << " parts";
  }
  const real minus_zero[] = {-real(0)};
  const real* parts[] = {minus_zero, minus_zero};
  real sum = 1;
  add_as_tree(1, parts, &sum);
  EXPECT_FALSE(std::signbit(sum));
}

}  // namespace
}  // namespace supertac::kernels
