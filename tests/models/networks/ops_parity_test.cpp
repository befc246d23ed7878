// Single ops against PyTorch (op_cases in tests/parity/make_parity.py): y and the gradients of sum(y * r).

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/linear.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"
#include "layers/checkpoint.h"
#include "tests/parity/parity.h"
#include "tests/support/test.h"

namespace supertac::ops_parity_test {

using test::counter_numbers;

// How PyTorch orders our axes: as a parameter of this layout is stored, or as a map, [N,C,P...] of
// [N,P...,C].
using Order = std::optional<Layout>;
constexpr Order kMap = std::nullopt;

struct Input {
  std::string name;
  Shape shape;  // ours
  Order order = Layout::plain;
};

// Where element i of PyTorch's order lies in ours.
std::vector<std::size_t> places(const Shape& shape, Order order) {
  if (order) return test::places(shape, *order);
  std::vector<std::size_t> at;
  const Dim channels = shape[shape.rank() - 1], pixels = shape.elements() / shape[0] / channels;
  for (Dim n = 0; n < shape[0]; ++n) {
    for (Dim c = 0; c < channels; ++c) {
      for (Dim p = 0; p < pixels; ++p)
        at.push_back(static_cast<std::size_t>((n * pixels + p) * channels + c));
    }
  }
  return at;
}

Tensor numbers(const std::string& name, const Shape& shape, Order order) {
  Tensor t(shape);
  const std::vector<std::size_t> at = places(shape, order);
  const std::vector<double> values = counter_numbers(name, at.size());
  for (std::size_t i = 0; i < at.size(); ++i) t.data()[at[i]] = static_cast<real>(values[i]);
  return t;
}

void expect_stored(const std::string& name, const Tensor& found, Order order) {
  static const SafetensorsFile file = SafetensorsFile::read(SUPERTAC_PARITY_DIR "/ops.safetensors");
  std::vector<double> values;
  for (const std::size_t at : places(found.shape(), order)) {
    values.push_back(static_cast<double>(found.data()[at]));
  }
  const test::Difference d = test::difference(values, test::stored(file, name));
  EXPECT_LE(sizeof(real) == 8 ? d.by_entry : d.by_tensor, sizeof(real) == 8 ? 1e-10 : 1e-5)
      << name << " (in PyTorch's order), " << d.worst;
}

void expect_parity(const std::string& op, const std::vector<Input>& inputs, Order y_order,
                   const std::function<Variable(const std::vector<Variable>&)>& f) {
  std::vector<Variable> leaves;
  for (const Input& in : inputs) leaves.emplace_back(numbers(op + "." + in.name, in.shape, in.order), true);
  const Variable y = f(leaves);
  expect_stored(op + ".y", y.value(), y_order);
  backward(sum(y * Variable(numbers(op + ".r", y.shape(), y_order))));
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    expect_stored(op + "." + inputs[i].name + ".grad", leaves[i].grad(), inputs[i].order);
  }
}

constexpr ConvOptions kHalving{.stride = 2, .padding = 1};

TEST(OpsParity, Convolutions) {
  expect_parity("conv1d", {{"x", {2, 9, 3}, kMap}, {"w", {3, 3, 5}, Layout::conv}, {"b", {5}}}, kMap,
                [](const auto& in) { return conv1d(in[0], in[1], in[2], kHalving); });
  expect_parity("conv2d", {{"x", {2, 5, 7, 3}, kMap}, {"w", {3, 3, 3, 17}, Layout::conv}, {"b", {17}}}, kMap,
                [](const auto& in) { return conv2d(in[0], in[1], in[2], kHalving); });
  expect_parity("conv2d_leaky", {{"x", {2, 5, 7, 3}, kMap}, {"w", {3, 3, 3, 17}, Layout::conv}, {"b", {17}}},
                kMap, [](const auto& in) {
                  return conv2d(in[0], in[1], in[2], {.padding = 1, .negative_slope = kLeakyRelu});
                });
}

TEST(OpsParity, TransposedConvolutions) {
  expect_parity("conv_transpose1d",
                {{"x", {2, 5, 3}, kMap}, {"w", {4, 3, 5}, Layout::conv_transpose}, {"b", {5}}}, kMap,
                [](const auto& in) { return conv_transpose1d(in[0], in[1], in[2], kHalving); });
  expect_parity("conv_transpose2d",
                {{"x", {2, 4, 3, 3}, kMap}, {"w", {4, 4, 3, 5}, Layout::conv_transpose}, {"b", {5}}}, kMap,
                [](const auto& in) { return conv_transpose2d(in[0], in[1], in[2], kHalving); });
}

TEST(OpsParity, Linear) {
  expect_parity("linear", {{"x", {3, 33}}, {"w", {33, 17}, Layout::linear}, {"b", {17}}}, Layout::plain,
                [](const auto& in) { return linear(in[0], in[1], in[2]); });
  expect_parity("linear_relu", {{"x", {3, 33}}, {"w", {33, 17}, Layout::linear}, {"b", {17}}}, Layout::plain,
                [](const auto& in) { return linear(in[0], in[1], in[2], kRelu); });
}

TEST(OpsParity, OfImages) {
  expect_parity("max_pool2d", {{"x", {2, 5, 4, 3}, kMap}}, kMap,
                [](const auto& in) { return max_pool2d(in[0]); });
  expect_parity("gated_sum", {{"a", {2, 4, 5, 3}, kMap}, {"x", {2, 4, 5, 3}, kMap}, {"s", {2, 3}}}, kMap,
                [](const auto& in) { return gated_sum(in[0], in[1], in[2]); });
  expect_parity("global_mean", {{"x", {2, 4, 5, 3}, kMap}}, Layout::plain,
                [](const auto& in) { return global_mean(in[0]); });
}

TEST(OpsParity, OfElements) {
  using Leaves = std::vector<Variable>;
  const std::pair<const char*, std::function<Variable(const Leaves&)>> of_one[] = {
      {"sigmoid", [](const Leaves& in) { return sigmoid(in[0]); }},
      {"relu", [](const Leaves& in) { return relu(in[0]); }},
      {"leaky_relu", [](const Leaves& in) { return leaky_relu(in[0]); }},
      {"clamp", [](const Leaves& in) { return clamp(in[0], -0.5, 0.25); }},
      {"scale", [](const Leaves& in) { return -3 * in[0]; }},
      {"sum", [](const Leaves& in) { return sum(in[0]); }}};
  for (const auto& [op, f] : of_one) expect_parity(op, {{"x", {3, 33}}}, Layout::plain, f);
  const std::pair<const char*, std::function<Variable(const Leaves&)>> of_two[] = {
      {"add", [](const Leaves& in) { return in[0] + in[1]; }},
      {"multiply", [](const Leaves& in) { return in[0] * in[1]; }},
      {"subtract", [](const Leaves& in) { return 2 - (in[0] - in[1]); }}};
  for (const auto& [op, f] : of_two) expect_parity(op, {{"a", {3, 33}}, {"b", {3, 33}}}, Layout::plain, f);
  const Tensor eps = numbers("sample_gaussian.eps", {3, 4}, Layout::plain);
  expect_parity("sample_gaussian", {{"mean", {3, 4}}, {"log_var", {3, 4}}}, Layout::plain,
                [&](const auto& in) { return sample_gaussian(in[0], in[1], eps); });
}

TEST(OpsParity, OfPlaces) {
  expect_parity("concat", {{"x0", {2, 3, 4}}, {"x1", {2, 3, 17}}}, Layout::plain,
                [](const auto& in) { return concat(in); });
  expect_parity("flatten", {{"x", {2, 3, 5, 4}, kMap}}, Layout::plain,
                [](const auto& in) { return flatten_channels_first(in[0]); });
  expect_parity("unflatten", {{"x", {2, 18}}}, kMap, [](const auto& in) {
    return unflatten_channels_first(in[0], std::array<Dim, 2>{2, 3});
  });
}

TEST(OpsParity, Losses) {
  expect_parity("l2_loss", {{"x", {2, 5, 3}}, {"target", {2, 5, 3}}}, Layout::plain,
                [](const auto& in) { return l2_loss(in[0], in[1]); });
  expect_parity("kl_divergence", {{"mean", {3, 4}}, {"log_var", {3, 4}}}, Layout::plain,
                [](const auto& in) { return kl_divergence(in[0], in[1]); });
  expect_parity("softmax_cross_entropy", {{"logits", {3, 7}}}, Layout::plain, [](const auto& in) {
    const std::int32_t labels[] = {2, 0, 6};
    return softmax_cross_entropy(in[0], labels);
  });
}

TEST(OpsParity, Ssim) {
  const std::pair<std::string, Shape> cases[] = {{"ssim", {2, 16, 13, 1}}, {"ssim8", {2, 8, 9, 1}}};
  for (const auto& [name, shape] : cases) {
    Tensor target = numbers(name + ".target", shape, Layout::plain);
    for (real& x : target.values()) x = std::abs(x);
    expect_parity(name, {{"x", shape}}, Layout::plain, [&](const auto& in) { return ssim(in[0], target); });
  }
}

}  // namespace supertac::ops_parity_test
