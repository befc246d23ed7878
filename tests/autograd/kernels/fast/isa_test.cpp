// All instruction sets give the same bytes; kernels/conv_test.cpp compares convolutions and linear layers.
#include "autograd/kernels/fast/isa/isa.h"

#include <algorithm>
#include <limits>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/vae.h"
#include "autograd/optimisers/adam.h"
#include "tests/autograd/check.h"

namespace supertac::kernels {
namespace {

using test::numbers;
using test::same_bytes;

std::vector<const IsaKernels*> available() {
  std::vector<const IsaKernels*> sets = supported_sets();
  sets.pop_back();  // plain has no kernels of its own, see kernels/conv_test.cpp
  return sets;
}

// The results of `run` with each set chosen are the same bytes.
template <class Run>
void expect_same_on_all_sets(const std::string& what, Run run) {
  const IsaKernels& chosen = isa_kernels();
  std::vector<Tensor> first;
  for (const IsaKernels* isa : available()) {
    use_isa(*isa);
    const std::vector<Tensor> found = run(*isa);
    if (first.empty()) first = found;
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_TRUE(same_bytes(found[i], first[i])) << isa->name << ", " << what << ", result " << i;
  }
  use_isa(chosen);
}

const ConvSettings kSettings[] = {
    {.height = 1, .width = 17, .kernel_w = 3, .stride_w = 2, .padding_w = 1},
    {.height = 1, .width = 5, .kernel_w = 4, .stride_w = 2, .padding_w = 1, .transposed = true},
    {.height = 4, .width = 4, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1},
    {.height = 9,
     .width = 6,
     .kernel_h = 3,
     .kernel_w = 3,
     .stride_h = 2,
     .stride_w = 2,
     .padding_h = 1,
     .padding_w = 1},
    {.height = 3,
     .width = 7,
     .kernel_h = 4,
     .kernel_w = 4,
     .stride_h = 2,
     .stride_w = 2,
     .padding_h = 1,
     .padding_w = 1,
     .transposed = true},
    {.height = 1, .width = 1, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1}};
constexpr Dim kChannels[] = {1, 3, 7, 8, 16, 17, 33, 64, 100};

std::string channels(Dim cin, Dim cout) { return std::to_string(cin) + " to " + std::to_string(cout); }

Tensor gather(const IsaKernels& isa, const std::vector<Phase>& phases, const Tensor& x, const Tensor& w,
              const Tensor* bias, Tensor y, Dim cin, Dim cout) {
  isa.gather({&phases, w.data(), bias ? bias->data() : nullptr, cin, cout,
              bias == nullptr ? Into::add : Into::overwrite, bias == nullptr ? real(1) : real(0.25)},
             x.data(), y.data());
  return y;
}

// A sum that is -0 so far stays -0 where a tap is skipped, and becomes +0 where 0 * w is added: which of the
// two happens depends on the tile's neighbours, hence on the instruction set.
TEST(Isa, NegativeZeroHasTheSameSignEverywhere) {
  for (const ConvSettings& s : kSettings) {
    const Geometry& g = geometry_of(s);
    for (const Dim cout : {1, 5, 16, 33}) {
      const Dim cin = 2;
      const Tensor x = Tensor::full({g.in_pixels, cin}, real(-0.0)), bias = Tensor::full({cout}, real(-0.0));
      const Tensor w = Tensor::full({g.taps, cin, cout}, 1);
      expect_same_on_all_sets(channels(cin, cout), [&](const IsaKernels& isa) {
        return std::vector{gather(isa, g.forward, x, w, &bias, Tensor({g.out_pixels, cout}), cin, cout)};
      });
    }
  }
}

// Nothing outside [cout] may be written: the last vector is partial.
TEST(Isa, StaysWithinItsRows) {
  for (const IsaKernels* isa : available()) {
    for (const Dim cout : kChannels) {
      Tensor y = Tensor::full({cout + 40}, 7);
      const Tensor x = numbers({3}), w = numbers({3, cout}, 2);
      isa->gather_rows({nullptr, w.data(), nullptr, 3, cout}, x.data(), y.data(), 1);
      for (Dim i = cout; i < cout + 40; ++i) ASSERT_EQ(y.data()[i], 7) << isa->name << ' ' << cout;
    }
  }
}

// Numbers of every magnitude, with both zeros, denormals and infinities among them.
Tensor awkward(Dim n, std::uint64_t seed) {
  constexpr real kSpecial[] = {0,
                               real(-0.0),
                               1e-40F,
                               -1e-40F,
                               std::numeric_limits<real>::infinity(),
                               -std::numeric_limits<real>::infinity(),
                               100,
                               -100};
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
  for (const Dim n : {1, 5, 16, 33, 100, 257})
    expect_same_on_all_sets(std::to_string(n) + " numbers",
                            [&](const IsaKernels&) { return results_of_loops(n); });
}

TEST(Isa, TheChosenSetIsOneOfThem) {
  const std::vector<const IsaKernels*> sets = supported_sets();
  EXPECT_NE(std::find(sets.begin(), sets.end(), &isa_kernels()), sets.end()) << isa_kernels().name;
  EXPECT_EQ(sets.back(), &kPlainKernels);
}

}  // namespace
}  // namespace supertac::kernels
