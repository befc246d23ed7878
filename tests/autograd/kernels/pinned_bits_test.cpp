// The bits of convolutions and of Muon, as they are on every processor; those of the other ops stand in
// Trainer.PinnedBits. Whoever changes the arithmetic on purpose changes these numbers with it, and says so.

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/losses.h"
#include "autograd/optimisers/adam.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::pinned_bits_test {

using test::numbers;
using test::parameter;

// FNV-1a
std::uint64_t bits_of(const std::vector<Tensor>& tensors) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const Tensor& tensor : tensors)
    for (const real x : tensor.values()) hash = (hash ^ std::bit_cast<std::uint32_t>(x)) * 0x100000001b3U;
  return hash;
}

using Op = std::function<Variable(const std::vector<Variable>&)>;

// Of the value, and of the gradients of all inputs.
std::uint64_t bits_of(const Op& op, const std::vector<Shape>& shapes) {
  std::vector<Variable> leaves;
  for (std::size_t i = 0; i < shapes.size(); ++i) leaves.push_back(parameter(numbers(shapes[i], i + 1)));
  const Variable y = op(leaves);
  backward(sum(y * Variable(numbers(y.shape(), 9))));
  std::vector<Tensor> results = {y.value()};
  for (const Variable& leaf : leaves) results.push_back(leaf.grad());
  return bits_of(results);
}

TEST(PinnedBits, Convolutions) {
  const auto conv = [](Dim stride) -> Op {
    return [stride](const auto& in) {
      return conv2d(in[0], in[1], in[2], {.stride = stride, .padding = 1, .negative_slope = kLeakyRelu});
    };
  };
  const auto up = [](const auto& in) {
    return conv_transpose2d(in[0], in[1], in[2], {.stride = 2, .padding = 1});
  };
  EXPECT_EQ(bits_of(conv(1), {{1, 8, 8, 32}, {3, 3, 32, 32}, {32}}), 0xe3d9bcb1a467090bU) << "plain";
  EXPECT_EQ(bits_of(conv(1), {{5, 8, 8, 32}, {3, 3, 32, 32}, {32}}), 0x3de9902141a274dfU) << "Winograd";
  EXPECT_EQ(bits_of(conv(1), {{3, 16, 16, 32}, {3, 3, 32, 1}, {1}}), 0x1c98df7a13494441U) << "few outputs";
  EXPECT_EQ(bits_of(conv(2), {{9, 1, 64, 16}, {3, 3, 16, 32}, {32}}), 0xb96b2aef83970398U) << "stride 2";
  EXPECT_EQ(bits_of(up, {{3, 4, 4, 32}, {4, 4, 32, 32}, {32}}), 0x0cfc0a2dc7af40b7U) << "transposed";
}

TEST(PinnedBits, Muon) {
  const Variable tall = parameter(numbers({3, 3, 16, 24})), wide = parameter(numbers({16, 40}, 2));
  Adam muon({tall, wide}, {.learning_rate = 0.01, .clip_norm = 1, .muon = true});
  const Variable a(numbers(tall.shape(), 3)), b(numbers(wide.shape(), 4));
  for (int step = 0; step < 20; ++step) {
    muon.zero_grad();
    backward(l2_loss(tall, a) + l2_loss(wide, b));
    muon.step();
  }
  EXPECT_EQ(bits_of({tall.value(), wide.value()}), 0xfaffca44ea026b4dU);
}

}  // namespace supertac::pinned_bits_test
