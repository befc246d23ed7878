// Compares each lesson with finite differences, or with numbers worked out by hand.
#include "docs/lessons/check/check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "autograd/optimisers/adam.h"

namespace lessons {
namespace {

struct Input {
  std::string name;
  std::vector<std::size_t> shape;
  Array values{};
};

std::size_t size_of(const std::vector<std::size_t>& shape) {
  std::size_t size = 1;
  for (const std::size_t n : shape) size *= n;
  return size;
}

std::vector<Input> filled(std::vector<Input> inputs) {
  double at = 1;
  for (Input& input : inputs)
    for (std::size_t i = 0; i < size_of(input.shape); ++i)
      input.values.push_back(0.5 + 0.4 * std::sin(at++ * 1.7));
  return inputs;
}

std::string place(const Input& input, std::size_t index) {
  std::string text = "]";
  for (std::size_t axis = input.shape.size(); axis-- > 0; index /= input.shape[axis])
    text = (axis > 0 ? "," : "[") + std::to_string(index % input.shape[axis]) + text;
  return input.name + " " + text;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

/// The entry that is furthest off, if one is; `expected` says where the other number comes from.
void compare(const std::string& what, const std::vector<Input>& inputs, const std::vector<Array>& yours,
             const std::vector<Array>& expected, const std::string& from) {
  constexpr double kTolerance = 1e-6;
  double worst = 0;
  std::size_t wrong = 0, count = 0;
  std::string text;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    double largest = 1e-3;
    for (const double e : expected[k]) largest = std::max(largest, std::abs(e));
    for (std::size_t i = 0; i < expected[k].size(); ++i, ++count) {
      const double error = std::abs(yours[k][i] - expected[k][i]) / largest;
      if (error <= kTolerance) continue;
      ++wrong;
      if (error <= worst) continue;
      worst = error;
      text =
          place(inputs[k], i) + ": yours " + number(yours[k][i]) + ", " + from + " " + number(expected[k][i]);
    }
  }
  if (wrong == 0) return std::printf("  %s: %zu entries agree\n", what.c_str(), count), void();
  throw Wrong{what + ", " + text + " (" + std::to_string(wrong) + " of " + std::to_string(count) +
              " entries are wrong)"};
}

using Value = std::function<Array(const std::vector<Input>&)>;
using Gradient = std::function<std::vector<Array>(const std::vector<Input>&, const Array& gy)>;

/// Differences of a five-point stencil of sum(y r), with weights r that no symmetry hides behind.
void check_gradient(const std::string& what, std::vector<Input> inputs, const Value& value,
                    const Gradient& gradient) {
  inputs = filled(std::move(inputs));
  Array gy = value(inputs);
  for (std::size_t i = 0; i < gy.size(); ++i) gy[i] = 1 + 0.3 * static_cast<double>(i * 7 % 5);
  const auto at = [&](double& x, double to) {
    const double before = x;
    x = to;
    const Array y = value(inputs);
    x = before;
    double sum = 0;
    for (std::size_t i = 0; i < y.size(); ++i) sum += y[i] * gy[i];
    return sum;
  };
  std::vector<Array> expected;
  for (Input& input : inputs) {
    Array& differences = expected.emplace_back();
    for (double& x : input.values) {
      constexpr double h = 1e-3;
      differences.push_back((8 * (at(x, x + h) - at(x, x - h)) - at(x, x + 2 * h) + at(x, x - 2 * h)) /
                            (12 * h));
    }
  }
  compare(what, inputs, gradient(inputs, gy), expected, "differences give");
}

void chain_rule() {
  // f = sigmoid(a b + c) a: a is used twice.
  const std::vector<Step> tape = {
      {Step::multiply, 0, 1, 3}, {Step::add, 3, 2, 4}, {Step::sigmoid, 4, 0, 5}, {Step::multiply, 5, 0, 6}};
  const auto values_of = [&](const std::vector<Input>& in) {
    Array values = in[0].values;
    values.resize(7);
    run(tape, values);
    return values;
  };
  check_gradient(
      "run_back", {{"dL/d value", {3}}}, [&](const auto& in) { return Array{values_of(in)[6]}; },
      [&](const auto& in, const Array& gy) {
        Array gradients(7);
        gradients[6] = gy[0];
        run_back(tape, values_of(in), gradients);
        gradients.resize(3);
        return std::vector<Array>{gradients};
      });
}

// The whole of lesson 1: downhill along the gradient.
void descend_tape() {
  const std::vector<Step> tape = {{Step::multiply, 0, 1, 3}, {Step::add, 3, 2, 4}, {Step::sigmoid, 4, 0, 5}};
  Array values = {0.5, 0.9, 0.3, 0, 0, 0};
  run(tape, values);
  const double before = values[5];
  for (int step = 0; step < 300; ++step) {
    Array gradients(6);
    gradients[5] = 1;
    run_back(tape, values, gradients);
    for (std::size_t i = 0; i < 3; ++i) values[i] -= 0.5 * gradients[i];
    run(tape, values);
  }
  std::printf("  the whole: sigmoid(a b + c) is %.4f before and %.4f after 300 steps downhill\n", before,
              values[5]);
  if (!(values[5] < 0.02))
    throw Wrong{"300 steps downhill, sigmoid [0]: yours " + number(values[5]) + ", expected below 0.02"};
}

void chain_rule_and_descent() {
  chain_rule();
  descend_tape();
}

void linear_layer() {
  const Table s{2, 3, 4};
  check_gradient(
      "linear_gradient", {{"gx", {2, 3}}, {"gw", {3, 4}}, {"gbias", {4}}},
      [&](const auto& in) {
        Array y(8);
        linear(s, in[0].values, in[1].values, in[2].values, y);
        return y;
      },
      [&](const auto& in, const Array& gy) {
        Array gx(6), gw(12), gbias(4);
        linear_gradient(s, in[0].values, in[1].values, gy, gx, gw, gbias);
        return std::vector<Array>{gx, gw, gbias};
      });
}

void convolution() {
  const Line s{7, 2, 3, 3, 2, 1};
  const Value value = [&](const auto& in) {
    Array y(s.out_length() * s.out);
    conv(s, in[0].values, in[1].values, in[2].values, y);
    return y;
  };
  check_gradient("conv_gradient", {{"gx", {7, 2}}, {"gw", {3, 2, 3}}, {"gbias", {3}}}, value,
                 [&](const auto& in, const Array& gy) {
                   Array gx(14), gw(18), gbias(3);
                   conv_gradient(s, in[0].values, in[1].values, gy, gx, gw, gbias);
                   return std::vector<Array>{gx, gw, gbias};
                 });
  // <conv(x), z> is linear in x: its differences are the transpose of z, with the kernel's two channels
  // swapped.
  check_gradient(
      "conv_transpose", {{"t", {7, 2}}},
      [&](const auto& in) {
        std::vector<Input> all = filled({{"", {7, 2}}, {"", {3, 2, 3}}, {"", {3}}});
        all[0].values = in[0].values;
        return value(all);
      },
      [&](const auto&, const Array& z) {
        const Array w = filled({{"", {7, 2}}, {"", {3, 2, 3}}})[1].values, no_bias(2);
        Array swapped(18), t(14);
        for (std::size_t i = 0; i < 18; ++i) swapped[(i / 6 * 3 + i % 3) * 2 + i / 3 % 2] = w[i];
        conv_transpose({s.out_length(), 3, 2, 3, 2, 1}, z, swapped, no_bias, t);
        return std::vector<Array>{t};
      });
}

void attention() {
  const Image s{5, 3};
  check_gradient(
      "channel_mean_gradient", {{"gx", {5, 3}}},
      [&](const auto& in) {
        Array mean(3);
        channel_mean(s, in[0].values, mean);
        return mean;
      },
      [&](const auto&, const Array& gy) {
        Array gx(15);
        channel_mean_gradient(s, gy, gx);
        return std::vector<Array>{gx};
      });
  check_gradient(
      "gated_sum_gradient", {{"ga", {5, 3}}, {"gx", {5, 3}}, {"ggate", {3}}},
      [&](const auto& in) {
        Array y(15);
        gated_sum(s, in[0].values, in[1].values, in[2].values, y);
        return y;
      },
      [&](const auto& in, const Array& gy) {
        Array ga(15), gx(15), ggate(3);
        gated_sum_gradient(s, in[1].values, in[2].values, gy, ga, gx, ggate);
        return std::vector<Array>{ga, gx, ggate};
      });
}

void sampling() {
  const Array eps = {0.3, -1.2, 2.1, -0.4};
  check_gradient(
      "sample_gradient", {{"gmean", {4}}, {"glog_var", {4}}},
      [&](const auto& in) {
        Array z(4);
        sample(in[0].values, in[1].values, eps, z);
        return z;
      },
      [&](const auto& in, const Array& gz) {
        Array gmean(4), glog_var(4);
        sample_gradient(in[1].values, eps, gz, gmean, glog_var);
        return std::vector<Array>{gmean, glog_var};
      });
  check_gradient(
      "divergence_gradient", {{"gmean", {4}}, {"glog_var", {4}}},
      [](const auto& in) { return Array{divergence(in[0].values, in[1].values)}; },
      [](const auto& in, const Array& gy) {
        Array gmean(4), glog_var(4);
        divergence_gradient(in[0].values, in[1].values, gy[0], gmean, glog_var);
        return std::vector<Array>{gmean, glog_var};
      });
}

void similarity() {
  constexpr std::size_t kSide = 8;
  Array truth(kSide * kSide);
  for (std::size_t i = 0; i < truth.size(); ++i)
    truth[i] = 0.5 + 0.5 * std::cos(static_cast<double>(i * i % 17));
  check_gradient(
      "ssim_gradient", {{"gx", {kSide, kSide}}},
      [&](const auto& in) { return Array{ssim(kSide, in[0].values, truth)}; },
      [&](const auto& in, const Array& gy) {
        Array gx(truth.size());
        ssim_gradient(kSide, in[0].values, truth, gy[0], gx);
        return std::vector<Array>{gx};
      });
}

void adam() {
  const Array gradients[] = {{1, -2, 0.5}, {0.1, -2, 1e-9}, {-1, 3, 0}};
  Variable theirs(Tensor::zeros({3}), true);
  supertac::Adam reference({theirs}, {.learning_rate = 0.1});
  Array m(3), v(3), x(3);
  for (long t = 1; t <= 3; ++t) {
    reference.zero_grad();
    for (std::size_t i = 0; i < 3; ++i) theirs.mutable_grad().data()[i] = gradients[t - 1][i];
    reference.step();
    adam_step({.rate = 0.1}, t, gradients[t - 1], m, v, x);
    const auto values = theirs.value().values();
    compare("adam_step, step " + std::to_string(t), {{"x", {3}}}, {x}, {Array(values.begin(), values.end())},
            "the project's Adam has");
  }
}

void safeguards() {
  const auto same = [](const std::string& what, const std::string& entry, double yours, double expected) {
    compare(what, {{entry, {1}}}, {{yours}}, {{expected}}, "it should be");
  };
  same("failure 13, a spike", "clip_factor(1e8, 1)", clip_factor(1e8, 1), 1e-8);
  same("failure 13, an ordinary gradient", "clip_factor(0.5, 1)", clip_factor(0.5, 1), 1);
  same("failure 3, a log variance that has run away", "clamp_gradient(200, 3)", clamp_gradient(200, 3), 0);
  same("failure 3, an ordinary one", "clamp_gradient(2, 3)", clamp_gradient(2, 3), 3);
  std::vector<float> level;
  for (int i = 0; i < 49; ++i) level.push_back(200 + 0.125F * static_cast<float>(i % 2));
  same("failure 7, 49 pixels at level 200", "variance", static_cast<double>(variance(level)), 0.00390462309);
  same("failure 11, half a second of silence", "may_follow(1, 1.5, 0.05)", may_follow(1, 1.5, 0.05), 0);
  same("failure 11, the next frame", "may_follow(1, 1.003, 0.05)", may_follow(1, 1.003, 0.05), 1);
}

}  // namespace

void check(int lesson) {
  constexpr void (*kLessons[])() = {
      chain_rule_and_descent, linear_layer, convolution, attention, sampling, similarity, adam, safeguards};
  kLessons[lesson - 1]();
}

}  // namespace lessons
