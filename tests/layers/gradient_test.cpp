// Every layer's gradients with respect to its input and all of its parameters, in double precision.
#include <gtest/gtest.h>

#include "autograd/gradient_checker.h"
#include "autograd/record.h"
#include "layers/convolution.h"
#include "layers/linear.h"
#include "layers/residual.h"
#include "tests/layers/noise.h"

namespace supertac {
namespace {

template <class Layer>
void expect_right_gradients(const Layer& layer, const Shape& shape) {
  const Variable x(noise(shape, 11), true);
  std::vector<Variable> leaves = values_of(layer.parameters());
  leaves.push_back(x);
  std::vector<std::string> names = names_of(layer.parameters());
  names.push_back("x");
  const GradientReport report = check_gradients([&] { return layer.forward(x); }, leaves, {.names = names});
  EXPECT_LE(report.max_relative_error, 1e-6) << report.text();
  EXPECT_GT(report.entries, x.size() < 200 ? x.size() : 200);
}

TEST(LayerGradients, Linear) {
  Rng rng(1);
  expect_right_gradients(Linear(5, 3, rng), {4, 5});
}

TEST(LayerGradients, Conv1d) {
  Rng rng(2);
  expect_right_gradients(Conv1d(3, 5, {.kernel = 3, .stride = 2, .padding = 1}, rng), {2, 9, 3});
}

TEST(LayerGradients, Conv2d) {
  Rng rng(3);
  expect_right_gradients(Conv2d(3, 5, {.kernel = 3, .stride = 1, .padding = 1}, rng), {2, 5, 4, 3});
}

TEST(LayerGradients, ConvTranspose1d) {
  Rng rng(4);
  expect_right_gradients(ConvTranspose1d(5, 3, {.kernel = 4, .stride = 2, .padding = 1}, rng), {2, 5, 5});
}

TEST(LayerGradients, ConvTranspose2d) {
  Rng rng(5);
  expect_right_gradients(ConvTranspose2d(5, 3, {.kernel = 4, .stride = 2, .padding = 1}, rng), {2, 3, 4, 5});
}

TEST(LayerGradients, Rcab) {
  Rng rng(7);
  expect_right_gradients(Rcab(8, 4, rng), {2, 4, 3, 8});
}

TEST(LayerGradients, Rirb) {
  Rng rng(8);
  expect_right_gradients(Rirb({.channels = 8, .reduction = 4, .blocks = 2}, rng), {1, 3, 4, 8});
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
  EXPECT_EQ(report.text().find("conv.1.weight [1,2,1,1] of [3,3,8,8]: analytic "), 0U) << report.text();
}

}  // namespace
}  // namespace supertac
