// What a report of wrong gradients says of a layer, and the inputs of every op one by one; `supertac-check
// gradients` compares all of apps/check/gradient_cases.cpp with finite differences.
#include <gtest/gtest.h>

#include <algorithm>

#include "apps/check/gradient_cases.h"
#include "autograd/gradient_checker.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/record.h"
#include "layers/residual.h"
#include "tests/layers/noise.h"

namespace supertac {
namespace {

TEST(OpGradients, AnInputHasTheSameOneWhereAllOthersAreConstants) {
  for (const GradientCase& c : op_cases()) {
    std::vector<Variable> all;
    for (const Variable& leaf : c.leaves) all.emplace_back(leaf.value(), true);
    backward(sum(c.of(all)));
    for (std::size_t i = 0; i < all.size(); ++i) {
      std::vector<Variable> one;
      for (std::size_t k = 0; k < all.size(); ++k) one.emplace_back(all[k].value(), k == i);
      backward(sum(c.of(one)));
      EXPECT_TRUE(std::ranges::equal(one[i].grad().values(), all[i].grad().values())) << c.options.names[i];
    }
  }
}

// The parameter's name as in a checkpoint, its indices as in memory: [kernel..., in, out].
TEST(LayerGradients, AReportNamesTheParameterAndItsElement) {
  Rng rng(9);
  const Rcab layer(8, 4, rng);
  const Variable x(noise({1, 3, 4, 8}, 11), true);
  const Variable weight = layer.parameters()[2].value;
  const auto f = [&] {  // a node that spoils one entry of the gradient on its way back
    const Variable spoiled = record("spoil", weight.value(), {&weight}, [](Backward& b) {
      Tensor* g = b.grad_of(0);
      for (Dim i = 0; i < g->size(); ++i) g->data()[i] += (i == 329 ? 2 : 1) * b.gy().data()[i];
    });
    return conv2d(x, spoiled, layer.parameters()[3].value, {.padding = 1});
  };
  const GradientReport report =
      check_gradients(f, values_of(layer.parameters()),
                      {.max_entries_per_input = 576, .names = names_of(layer.parameters())});
  EXPECT_EQ(report.wrong, 1);
  EXPECT_NE(report.text().find("\nconv.1.weight [1,2,1,1] of [3,3,8,8]: analytic "), std::string::npos)
      << report.text();
}

}  // namespace
}  // namespace supertac
