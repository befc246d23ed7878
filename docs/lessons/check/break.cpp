// The thirteen known failures of this network (tests/failures/README.md), each small enough to be seen at
// once.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/vae.h"
#include "autograd/optimisers/adam.h"
#include "io/files/file.h"
#include "io/numbers/random.h"
#include "layers/residual.h"
#include "models/training/loss/schedule.h"

namespace lessons {
namespace {

using Array = std::vector<double>;
using supertac::Adam;
using supertac::AdamOptions;
using supertac::Dim;
using supertac::RandomStream;
using supertac::Rng;
using supertac::Shape;
using supertac::Tensor;
using supertac::Variable;

struct Chart {
  std::string title, across, up;
  double first = 0, step = 1;     // across: of the first number, and from one to the next
  Array without = {}, with = {};  // the safeguard
};

Variable parameter(double value, Dim n = 1) { return Variable(Tensor::full({n, 1}, value), true); }

/// x under Adam, step by step; `loss` makes the loss of a step.
template <class F>
Array descend(const Variable& x, const AdamOptions& options, int steps, F loss) {
  Adam adam({x}, options);
  Array path;
  for (int step = 0; step < steps; ++step) {
    path.push_back(x.value().data()[0]);
    const Variable l = loss(step);
    adam.zero_grad();
    supertac::backward(l);
    adam.step();
  }
  return path;
}

Chart all_zero() {
  const Variable target(Tensor::full({1, 1}, 0.8));
  const auto pixel = [&](bool saturated) {
    const Variable x = parameter(saturated ? -20 : 0);
    // Plain descent: the gradient itself is seen.
    Array path;
    for (int step = 0; step < 100; ++step) {
      const Variable drawn = saturated ? supertac::sigmoid(x) : x;
      path.push_back(drawn.value().data()[0]);
      Variable handle = x;
      if (x.grad().defined()) handle.mutable_grad().fill(0);
      supertac::backward(supertac::l2_loss(drawn, target));
      handle.mutable_value().data()[0] -= 0.1 * x.grad().data()[0];
    }
    return path;
  };
  return {.title = "1: a sigmoid that has closed passes no gradient; a linear output does",
          .across = "step",
          .up = "pixel, should be .8",
          .without = pixel(true),
          .with = pixel(false)};
}

// One latent number, one signal: below the threshold of beta it is used, above it the prior wins.
Chart posterior_collapse() {
  const RandomStream random(3, 0);
  const auto divergences = [&](double beta) {
    const Variable gain = parameter(0.5), width = parameter(0), out = parameter(0.5);
    Adam adam({gain, width, out}, {.learning_rate = 0.02});
    Array path;
    for (int step = 0; step < 200; ++step) {
      const double x = std::sin(0.7 * step);
      const Variable mean = x * gain;
      const Variable z = supertac::sample_gaussian(
          mean, width, Tensor::full({1, 1}, random.normal(static_cast<std::uint64_t>(step))));
      const Variable kl = supertac::kl_divergence(mean, width);
      path.push_back(kl.item());
      const Variable seen = supertac::l2_loss(z * out, Variable(Tensor::full({1, 1}, x)));
      adam.zero_grad();
      supertac::backward(seen + beta * kl);
      adam.step();
    }
    return path;
  };
  return {.title = "2: with a large weight of the divergence (2, against .01) the latent number says nothing",
          .across = "step",
          .up = "divergence",
          .without = divergences(2),
          .with = divergences(0.01)};
}

Chart log_variance() {
  Chart chart{"3: the standard deviation of a log variance that runs away, and of a clamped one",
              "log variance", "log10 of exp(log_var / 2)", -20, 4};
  for (int log_var = -20; log_var <= 200; log_var += 4) {
    chart.without.push_back(log_var / 2.0 / std::numbers::ln10);
    chart.with.push_back(std::clamp(log_var, -10, 10) / 2.0 / std::numbers::ln10);
  }
  return chart;
}

Chart warm_up() {
  Chart chart{"4: a ramp that ends with a jump, and the schedule of this project", "step",
              "share of the peak rate"};
  const supertac::Schedule schedule{.peak = 1, .warm_up = 50, .total = 200};
  for (int step = 0; step < 200; ++step) {
    chart.without.push_back(step < 50 ? 0.1 * step / 50 : 1);
    chart.with.push_back(schedule.at(step));
  }
  return chart;
}

Chart noise() {
  Chart chart{"5: uniform noise has a third of the variance that the divergence assumes", "draws",
              "variance so far", 10, 10};
  const RandomStream random(1, 0);
  double uniform = 0, normal = 0;
  for (std::uint64_t n = 1; n <= 1000; ++n) {
    uniform += std::pow(2 * random.uniform(n) - 1, 2), normal += std::pow(random.normal(n), 2);
    if (n % 10 != 0) continue;
    chart.without.push_back(uniform / static_cast<double>(n)),
        chart.with.push_back(normal / static_cast<double>(n));
  }
  return chart;
}

// How much each of two terms moves a pixel that is `distance` off a textured truth.
Chart silent_term() {
  Chart chart{"6: SSIM with a weight of 0 does not act; with .1 it pulls beside L2",
              "distance from the truth", "length of SSIM's gradient, in thousandths", 0.02, 0.02};
  Tensor truth(Shape{1, 8, 8, 1});
  for (Dim i = 0; i < 64; ++i) truth.data()[i] = 0.5 + 0.5 * std::sin(static_cast<double>(i / 8));
  for (int at = 1; at <= 50; ++at) {
    Tensor moved = truth.clone();
    for (Dim i = 0; i < 64; ++i) moved.data()[i] += 0.02 * at * (i % 2 == 0 ? 1 : -1);
    const Variable x(moved, true);
    supertac::backward(-0.1 * supertac::ssim(x, truth));
    double squares = 0;
    for (const double g : x.grad().values()) squares += g * g;
    chart.without.push_back(0), chart.with.push_back(1000 * std::sqrt(squares));
  }
  return chart;
}

Chart cancelling() {
  Chart chart{"7: the variance of 49 pixels in single precision, as E[x^2] - E[x]^2 and about their mean",
              "level of the pixels", "variance, should be .0039", 0, 10};
  for (int level = 0; level < 60; ++level) {
    std::vector<float> x;
    for (int i = 0; i < 49; ++i)
      x.push_back(10 * static_cast<float>(level) + 0.125F * static_cast<float>(i % 2));
    float sum = 0, squares = 0, mean = 0, centred = 0;
    for (const float v : x) sum += v, squares += v * v, mean += v / 49;
    for (const float v : x) centred += (v - mean) * (v - mean) / 49;
    chart.without.push_back(static_cast<double>(squares / 49 - sum / 49 * (sum / 49)));
    chart.with.push_back(static_cast<double>(centred));
  }
  return chart;
}

// How many taps reach each output of a transposed convolution of stride 2.
Chart checkerboard() {
  Chart chart{"8: a constant doubled by kernel 3 and by kernel 4", "pixel", "value", 1};
  const auto doubled = [](std::size_t kernel) {
    constexpr std::size_t kLength = 16;
    Array row((kLength - 1) * 2 + kernel - 2);
    for (std::size_t l = 0; l < kLength; ++l)
      for (std::size_t k = 0; k < kernel; ++k)
        if (2 * l + k >= 1 && 2 * l + k - 1 < row.size())
          row[2 * l + k - 1] += 2.0 / static_cast<double>(kernel);
    return Array(row.begin() + 1, row.begin() + 29);
  };
  chart.without = doubled(3), chart.with = doubled(4);
  return chart;
}

Chart deep_stack() {
  Chart chart{"9: variance behind residual blocks with He's weights, and with those of this project",
              "blocks", "log10 of variance", 1};
  const auto grow = [](double factor) {
    Rng rng(5);
    Tensor x(Shape{1, 8, 8, 16});
    for (double& v : x.values()) v = rng.uniform(1);
    Variable h(x);
    Array path;
    for (int block = 0; block < 24; ++block) {
      const supertac::Rcab rcab(16, 4, rng);
      for (const supertac::Parameter& p : rcab.parameters())
        for (double& w : Variable(p.value).mutable_value().values()) w *= factor;
      h = rcab.forward(h);
      double squares = 0;
      for (const double v : h.value().values()) squares += v * v;
      path.push_back(std::log10(squares / static_cast<double>(h.size())));
    }
    return path;
  };
  chart.without = grow(std::sqrt(6.0)), chart.with = grow(1);
  return chart;
}

Chart saturated_gate() {
  Chart chart{"10: the gradient through a gate alone, and with the skip beside it", "bias of the gate",
              "dy / dx", -20};
  for (int bias = -20; bias <= 20; ++bias) {
    const double gate = 1 / (1 + std::exp(-bias));
    chart.without.push_back(gate), chart.with.push_back(1 + gate);
  }
  return chart;
}

Chart silence() {
  Chart chart{"11: half a second without frames, bridged by the last sample and left out", "frame", "signal"};
  for (int frame = 0; frame < 120; ++frame) {
    const auto signal = [](int at) { return 0.5 + 0.4 * std::sin(0.08 * at); };
    const bool lost = frame >= 40 && frame < 90;
    chart.without.push_back(signal(lost ? 39 : frame));
    chart.with.push_back(lost ? std::nan("") : signal(frame));
  }
  return chart;
}

// Windows of 32 frames, one in five is tested.
Chart leakage() {
  Chart chart{
      "12: tested windows that share frames with trained ones, when windows and when trials are dealt out",
      "frames between windows", "share", 1};
  const RandomStream random(1, 0);
  for (int stride = 1; stride <= 40; ++stride) {
    int tested = 0, leaked = 0;
    const auto is_test = [&](int i) { return random.uniform(static_cast<std::uint64_t>(i)) < 0.2; };
    for (int i = 40; i < 400; ++i) {
      if (!is_test(i)) continue;
      ++tested;
      bool shares = false;
      for (int other = i - 32 / stride; other <= i + 32 / stride; ++other)
        shares = shares || (!is_test(other) && std::abs(other - i) * stride < 32);
      leaked += shares;
    }
    chart.without.push_back(static_cast<double>(leaked) / tested), chart.with.push_back(0);
  }
  return chart;
}

Chart spike() {
  const auto path = [](double clip) {
    const Variable x = parameter(0);
    const Variable target(Tensor::full({1, 1}, 1));
    return descend(x, {.learning_rate = 0.02, .clip_norm = clip}, 150,
                   [&](int step) { return (step == 20 ? 1e8 : 1) * supertac::l2_loss(x, target); });
  };
  return {.title = "13: a gradient of 1e8 at step 20 stops Adam for good, unless it is clipped",
          .across = "step",
          .up = "parameter, should be 1",
          .without = path(0),
          .with = path(1)};
}

std::string line(const Array& values, double low, double high, const char* colour) {
  std::string path;
  bool pen = false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      pen = false;
      continue;
    }
    char point[64];
    std::snprintf(point, sizeof point, "%s%.1f %.1f ", pen ? "L" : "M",
                  60 + 520 * static_cast<double>(i) / static_cast<double>(values.size() - 1),
                  250 - 200 * (values[i] - low) / (high - low));
    path += point;
    pen = true;
  }
  return "<path d='" + path + "' fill='none' stroke='" + colour + "' stroke-width='2'/>\n";
}

std::string text(double x, double y, const std::string& words, const char* colour = "black") {
  char place[96];
  std::snprintf(place, sizeof place, "<text x='%.0f' y='%.0f' fill='%s'>", x, y, colour);
  return place + words + "</text>\n";
}

std::string drawn(const Chart& chart) {
  double low = 0, high = 1e-9;
  for (const Array* values : {&chart.without, &chart.with})
    for (const double v : *values)
      if (std::isfinite(v)) low = std::min(low, v), high = std::max(high, v);
  const auto number = [](double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.3g", value);
    return std::string(digits);
  };
  const double last = chart.first + chart.step * static_cast<double>(chart.without.size() - 1);
  return "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 640 310' font-family='sans-serif' "
         "font-size='12'>\n"
         "<rect width='640' height='310' fill='white'/><rect x='60' y='50' width='520' height='200' "
         "fill='none' stroke='#999'/>\n" +
         text(10, 20, chart.title) + text(60, 42, chart.up) + text(250, 285, chart.across) +
         text(8, 250, number(low)) + text(8, 58, number(high)) + text(60, 266, number(chart.first)) +
         text(560, 266, number(last)) + text(60, 302, "without the safeguard", "#c02020") +
         text(250, 302, "with it", "#2050c0") + line(chart.without, low, high, "#c02020") +
         line(chart.with, low, high, "#2050c0") + "</svg>\n";
}

// Failure 1 to 13 as a chart: what happens without the safeguard and with it.
std::string break_it(int failure) {
  constexpr Chart (*kFailures[])() = {
      all_zero,     posterior_collapse, log_variance,   warm_up, noise,   silent_term, cancelling,
      checkerboard, deep_stack,         saturated_gate, silence, leakage, spike};
  if (failure < 1 || failure > 13)
    throw std::invalid_argument("failures are 1 to 13, got " + std::to_string(failure));
  const Chart chart = kFailures[failure - 1]();
  double apart = 0;
  for (std::size_t i = 0; i < std::min(chart.without.size(), chart.with.size()); ++i)
    if (std::isfinite(chart.with[i]))
      apart = std::max(apart, std::abs(chart.without[i] - chart.with[i]));
    else
      apart = std::max(apart, 1.0);
  std::printf("%s\n  furthest apart: %.3g\n", chart.title.c_str(), apart);
  if (!(apart > 1e-3)) throw std::runtime_error("the safeguard makes no difference");
  return drawn(chart);
}

}  // namespace
}  // namespace lessons

int main(int argc, char** argv) try {
  if (argc != 3) return std::fputs("usage: lessons_break 1 to 13 PICTURE.svg\n", stderr), 2;
  supertac::write_file(argv[2], lessons::break_it(std::atoi(argv[1])));
} catch (const std::exception& error) {
  std::fprintf(stderr, "lessons_break: %s\n", error.what());
  return 1;
}
