// All instruction sets give the same bytes; kernels/conv_test.cpp compares convolutions and linear layers.
#include "autograd/kernels/fast/isa/isa.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/vae.h"
#include "autograd/optimisers/adam.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::kernels {
namespace {

using test::numbers;

// Numbers of every magnitude, with both zeros, denormals and infinities among them.
Tensor awkward(Dim n, std::uint64_t seed) {
  constexpr real kEndless = std::numeric_limits<real>::infinity();
  constexpr real kSpecial[] = {0, real(-0.0), 1e-40F, -1e-40F, kEndless, -kEndless, 100, -100};
  Tensor t = numbers({n}, seed, -9, 9);
  for (Dim i = 0; i < n; ++i) {
    if (i % 11 == 0) t.data()[i] = kSpecial[i / 11 % 8];
  }
  return t;
}

// What the ops without kernels of their own make of n numbers: values and gradients.
std::vector<Tensor> results_of_loops(Dim n) {
  using Leaves = std::vector<Variable>;
  const Tensor a = awkward(n, 1), b = awkward(n, 2), c = numbers({n}, 3);
  std::vector<Tensor> rows;
  const auto run = [&](const std::vector<Tensor>& inputs, const std::function<Variable(const Leaves&)>& op) {
    Leaves leaves;
    for (const Tensor& x : inputs) leaves.emplace_back(x, true);
    for (int twice = 0; twice < 2; ++twice) {  // a first gradient is written, a second one added
      const Variable y = op(leaves);
      backward(sum(y * Variable(Tensor::of(y.shape(), awkward(y.size(), 8).values()))));
      rows.push_back(y.value());
    }
    for (const Variable& x : leaves) rows.push_back(x.grad());
  };
  run({a}, [](const Leaves& in) { return leaky_relu(in[0]); });
  run({a}, [](const Leaves& in) { return relu(in[0]); });
  run({a}, [](const Leaves& in) { return sigmoid(in[0]); });
  run({a}, [](const Leaves& in) { return clamp(in[0], -1, 1); });
  run({a}, [](const Leaves& in) { return 0.3F * in[0]; });
  run({a, b}, [](const Leaves& in) { return in[0] + in[1]; });
  run({a, b}, [](const Leaves& in) { return in[0] * in[1]; });
  const Shape row{1, n};
  const Tensor row_a = Tensor::of(row, a.values()), row_b = Tensor::of(row, b.values()),
               eps = Tensor::of(row, c.values());
  run({row_a, row_b}, [&](const Leaves& in) { return sample_gaussian(in[0], in[1], eps); });
  run({row_a, row_b}, [](const Leaves& in) { return kl_divergence(in[0], in[1]); });
  const Tensor pixels = numbers({1, 3, 1, n}, 4), others = numbers({1, 3, 1, n}, 5);
  run({pixels}, [](const Leaves& in) { return global_mean(in[0]); });
  run({others, pixels, numbers({1, n}, 6)}, [](const Leaves& in) { return gated_sum(in[0], in[1], in[2]); });
  // the gradient of a loss, and two steps of Adam along it
  const Variable parameter(numbers({n}, 7), true);
  Adam adam({parameter}, {.learning_rate = 0.1});
  for (int step = 0; step < 2; ++step) {
    adam.zero_grad();
    backward(l2_loss(parameter, Variable(c)));
    adam.step();
  }
  rows.push_back(parameter.grad());
  rows.push_back(parameter.value());
  return rows;
}

TEST(Isa, PlainLoops) {
  const IsaKernels& chosen = isa_kernels();
  for (const Dim n : {1, 5, 16, 33, 100, 257}) {
    std::vector<Tensor> first;
    for (const IsaKernels* isa : supported_sets()) {
      use_isa(*isa);
      const std::vector<Tensor> found = results_of_loops(n);
      if (first.empty()) first = found;
      for (std::size_t i = 0; i < found.size(); ++i)
        EXPECT_TRUE(test::same_bytes(found[i], first[i])) << isa->name << ", " << n << ", result " << i;
    }
  }
  use_isa(chosen);
}

TEST(Isa, TheChosenSetIsOneOfThem) {
  const std::vector<const IsaKernels*> sets = supported_sets();
  EXPECT_NE(std::find(sets.begin(), sets.end(), &isa_kernels()), sets.end()) << isa_kernels().name;
  EXPECT_EQ(sets.back(), &kPlainKernels);
}

}  // namespace
}  // namespace supertac::kernels
