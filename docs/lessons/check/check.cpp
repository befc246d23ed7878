// Looks at one lesson: compiled with LESSON=N and ENGINE, the header with pieces 1 to N of the student's
// engine.
#include ENGINE

#include <cstdio>
#include <functional>

#include "docs/lessons/check/checker.h"

namespace {

using lessons::Compared, lessons::numbers, lessons::Report, lessons::slope;

// A term's slopes at seven places beside differences of its value.
[[maybe_unused]] void check_term(Report& report, const std::string& name, Term (*term)(In), int inputs,
                                 double low = -2, double high = 2) {
  for (int by = 0; by < inputs; ++by) {
    Compared slopes{"the slope by a[" + std::to_string(by) + "]", {7}};
    for (std::size_t i = 0; i < 7; ++i) {
      double a[5] = {0.7, 0.7, 0.7, 0.7, 0.7};
      for (int k = 0; k < inputs; ++k) a[k] = numbers(7, low + 0.1 * k, high - 0.07 * k)[i];
      slopes.yours.push_back(term(a)[by + 1]);
      slopes.right.push_back(slope(a[by], [&] { return term(a)[0]; }));
    }
    report.add(name, slopes, "differences give");
  }
}

#if LESSON >= 3 && LESSON <= 8
[[maybe_unused]] Tensor made(const Shape& s, double low = -1) {
  return tensor(s, numbers(std::size_t(s.size()), low));
}

// The gradients of an op's inputs beside differences; the loss is a sum of y with irregular weights.
void check_op(Report& report, const std::string& what, const std::vector<std::string>& names,
              const std::vector<Shape>& shapes, const std::function<Tensor(const std::vector<Tensor>&)>& op,
              double low = -1) {
  std::vector<Tensor> xs;
  for (const Shape& s : shapes) xs.push_back(made(s, low + 0.03 * double(xs.size())));
  const auto weight = [](std::size_t i) {
    return (0.5 + std::fmod(0.61803398875 * double(i + 1), 1.0)) * (i % 3 == 1 ? -1 : 1);
  };
  const auto loss = [&] {
    tape.clear();
    const Tensor y = op(xs);
    double sum = 0;
    for (std::size_t i = 0; i < y->value.size(); ++i) sum += weight(i) * y->value[i];
    return sum;
  };
  for (int time = 0; time < 2; ++time) {  // twice: what is set where it should be added is half in the end
    tape.clear();
    const Tensor y = op(xs);
    for (std::size_t i = 0; i < y->grad.size(); ++i) y->grad[i] = weight(i);
    for (auto step = tape.rbegin(); step != tape.rend(); ++step) (*step)();
  }
  for (std::size_t k = 0; k < xs.size(); ++k) {
    Compared gradient{"the gradient of " + names[k], {xs[k]->c, xs[k]->h, xs[k]->w}};
    for (std::size_t i = 0; i < xs[k]->value.size(); ++i) {
      gradient.yours.push_back(xs[k]->grad[i] / 2);
      gradient.right.push_back(slope(xs[k]->value[i], loss));
    }
    report.add(what, gradient, "differences give");
  }
  tape.clear();
}
#endif

#if LESSON == 1
void check(Report& report) {
  check_term(report, "same", same, 1);
  check_term(report, "relu", relu, 1);
  check_term(report, "leaky_relu", leaky_relu, 1);
  check_term(report, "limited", limited, 1, -17, 17);
  check_term(report, "sigmoid", sigmoid, 1, -4, 4);
  // e^800 is infinite.
  Compared far{"the slope at a[0] = -800 and 800", {2}, {}, {0, 0}};
  for (const double a : {-800., 800.}) far.yours.push_back(sigmoid(&a)[1]);
  report.add("sigmoid", far);
  check_term(report, "product", product, 2);
}
#elif LESSON == 2
void check(Report& report) {
  report.add("size of [2][3][4]", Shape{2, 3, 4}.size(), 24);
  report.add("size of a vector of 5", Shape{5}.size(), 5);
  if (report.wrong() > 0) return;  // a tensor that is too small is written beyond its end
  const Tensor x = tensor({2, 2, 2}, {1, 2, 3, 4, 5, 6, 7, 8}), zeros = tensor({3});
  report.add("tensor", {"value", {2, 2, 2}, x->value, {1, 2, 3, 4, 5, 6, 7, 8}});
  report.add("tensor", {"gradient", {2, 2, 2}, x->grad, Array(8)});
  report.add("tensor without values", {"value", {3}, zeros->value, Array(3)});
}
#elif LESSON == 3
void check(Report& report) {
  check_op(report, "each, of products", {"x", "y"}, {{2, 2, 3}, {2, 2, 3}}, [](const auto& x) {
    return each(*x[0], {x[0], x[1]}, product);
  });
  check_op(report, "each, a number for each channel", {"x", "y"}, {{2, 2, 3}, {2}}, [](const auto& x) {
    return each(*x[0], {x[0], x[1]}, product);
  });
  check_op(report, "each, added up to one number", {"x"}, {{2, 3}}, [](const auto& x) {
    return each({1}, {x[0], x[0]}, product);
  });
  check_op(report, "each, added up for each channel", {"x"}, {{2, 1, 3}}, [](const auto& x) {
    return each({2}, {x[0], x[0]}, product);
  });
  tape.clear();
  const Tensor x = tensor({1}, {3}), y = each({1}, {x, x}, product), z = each({1}, {y, x}, product);
  backward(add(z, 1, y));
  report.add("backward, the derivative of x * x * x + x * x at 3", x->grad[0], 33);
  report.add("backward, steps that are left on the tape", double(tape.size()), 0);
  x->grad[0] = 0;
  backward(each({1}, {x, x}, product));
  report.add("a second forward and backward, the derivative of x * x at 3", x->grad[0], 6);
}
#elif LESSON == 4
void check(Report& report) {
  static Products some{{0, 0, 0}, {1, 2, 0}, {2, 1, 1}, {1, 1, 2}, {5, 3, 2}, {4, 0, 1}}, table;
  check_op(report, "bilinear", {"w", "x"}, {{6}, {4}},
           [](const auto& x) { return bilinear({3}, x[0], x[1], some); });
  for (int o = 0; o < 3; ++o)
    for (int i = 0; i < 4; ++i) table.push_back({o * 4 + i, i, o});
  check_op(report, "a linear layer of 4 to 3", {"w", "x"}, {{3, 4}, {4}},
           [](const auto& x) { return bilinear({3}, x[0], x[1], table); });
}
#elif LESSON == 5
// The formula, place by place.
Array by_formula(const Tensor& w, const Tensor& x, Shape y, Kernel k) {
  Array all(std::size_t(y.size()));
  const bool flat = x->h == 1;
  const auto at = [](const Shape& s, int c, int row, int column) {
    return std::size_t((c * s.h + row) * s.w + column);
  };
  const Shape coarse = k.up ? Shape(*x) : y, fine = k.up ? y : Shape(*x);
  const int rows = flat ? 1 : k.size;
  for (int o = 0; o < y.c; ++o)
    for (int i = 0; i < x->c; ++i)
      for (int tap = 0; tap < rows * k.size; ++tap)
        for (int row = 0; row < coarse.h; ++row)
          for (int column = 0; column < coarse.w; ++column) {
            const int down = flat ? 0 : row * k.stride + tap / k.size - k.pad;
            const int across = column * k.stride + tap % k.size - k.pad;
            if (down < 0 || down >= fine.h || across < 0 || across >= fine.w) continue;
            const int number = (k.up ? i * y.c + o : o * x->c + i) * rows * k.size + tap;
            const auto p = at(k.up ? y : Shape(*x), k.up ? o : i, down, across);
            const auto q = at(k.up ? Shape(*x) : y, k.up ? i : o, row, column);
            all[k.up ? p : q] += w->value[std::size_t(number)] * x->value[k.up ? q : p];
          }
  return all;
}

void check(Report& report) {
  const struct {
    std::string name;
    Shape x;
    Kernel k;
  } cases[] = {{"one tap (a linear layer)", {4}, kOne},     {"along time, stride 1", {2, 1, 5}, kSame},
               {"along time, stride 2", {2, 1, 6}, kHalve}, {"along time, transposed", {2, 1, 3}, kDouble},
               {"a map, stride 1", {2, 3, 4}, kSame},       {"a map, without padding", {2, 4, 5}, {3}},
               {"a map, transposed", {2, 2, 3}, kDouble}};
  for (const auto& c : cases) {
    const int taps = (c.x.h == 1 ? 1 : c.k.size) * c.k.size;
    const Shape w{3 * c.x.c * taps};
    const Tensor weights_of = made(w, -0.9), x = made(c.x);
    const Tensor y = convolve(c.name, weights_of, x, 3, c.k);
    const int wrong = report.wrong();
    report.add(c.name, {"y", {y->c, y->h, y->w}, y->value, by_formula(weights_of, x, *y, c.k)},
               "the formula gives");
    if (report.wrong() > wrong) continue;  // right gradients of a wrong value are nothing to praise
    check_op(report, c.name, {"w", "x"}, {w, c.x},
             [c](const auto& in) { return convolve(c.name, in[0], in[1], 3, c.k); });
  }
}
#elif LESSON == 6
void check(Report& report) {
  check_term(report, "gated", gated, 3);
  const int wrong = report.wrong();
  const Tensor m = channel_mean(tensor({2, 2, 2}, {1, 2, 6, 3, -1, 0, 4, 1}));
  report.add("channel_mean", {"value", {2}, m->value, {3, 1}});
  if (report.wrong() > wrong) return;
  check_op(report, "channel_mean", {"x"}, {{2, 3, 4}}, [](const auto& x) { return channel_mean(x[0]); });
}
#elif LESSON == 7
void check(Report& report) {
  check_term(report, "sample of mean, log_var", sample, 2);
  check_term(report, "kld of mean, log_var", kld, 2);
  const double standard[] = {0, 0};
  report.add("kld of N(0, 1)", kld(standard)[0], 0);
}
#elif LESSON == 8
void check(Report& report) {
  check_term(report, "squared_difference", squared_difference, 2);
  const Tensor truth = made({1, 12, 13}, 0.2);
  check_op(
      report, "ssim", {"x"}, {{1, 12, 13}}, [truth](const auto& x) { return ssim(x[0], truth); }, 0);
  report.add("ssim of a picture and itself", ssim(truth, truth)->value[0], 1);
}
#elif LESSON == 9
void check(Report& report) {
  const double gradients[3][4] = {{1, -2, 0.5, 0}, {0.1, -2, 1e-9, 0}, {-1, 3, 0, 1e-3}};
  const Tensor w = tensor({4}, {0.1, 0.2, 0.3, 0.4});
  Array m(4), v(4), x = w->value;
  for (int t = 1; t <= 3; ++t) {
    for (std::size_t i = 0; i < 4; ++i) {
      const double g = 0.5 * gradients[t - 1][i];
      w->grad[i] = gradients[t - 1][i];
      m[i] = 0.9 * m[i] + 0.1 * g, v[i] = 0.999 * v[i] + 0.001 * g * g;
      x[i] -= 0.01 * m[i] / (1 - std::pow(0.9, t)) / (std::sqrt(v[i] / (1 - std::pow(0.999, t))) + 1e-8);
    }
    adam(*w, 0.5, 0.01, t);
    const std::string step = "step " + std::to_string(t);
    report.add(step, {"x", {4}, w->value, x}, "the formula gives");
    report.add(step, {"m", {4}, w->m, m}, "the formula gives");
    report.add(step, {"v", {4}, w->v, v}, "the formula gives");
    report.add(step, {"gradient afterwards", {4}, w->grad, Array(4)});
  }
}
#elif LESSON == 10
// Uniform numbers within `bound`: none is beyond it, and of so many one is near it.
void check_drawn(Report& report, const std::string& name, const std::string& bound_text, double bound) {
  double largest = 0;
  for (const double at : weights[name]->value) largest = std::max(largest, std::abs(at));
  report.add(name + ", numbers of it beyond " + bound_text, largest > bound ? 1 : 0, 0);
  report.add(name + ", is its largest below 0.8 of " + bound_text, largest < 0.8 * bound ? 1 : 0, 0);
}

void check(Report& report) {
  const Tensor x = tensor({2, 1, 6}, {0.1, 0.7, -0.3, 0.4, 0.9, 0.2, -0.5, 0.6, 0.8, -0.1, 0.3, 0.5});
  const Tensor y = layer("conv", x, 3, kHalve, leaky_relu);
  report.add("layer, how many weights it made", double(weights.size()), 2);
  report.add("layer, conv.weight: its numbers",
             weights.count("conv.weight") ? weights["conv.weight"]->size() : 0, 18);
  report.add("layer, conv.bias: its numbers", weights.count("conv.bias") ? weights["conv.bias"]->size() : 0,
             3);
  if (report.wrong() > 0) return;
  Tensor b = weights["conv.bias"], w = weights["conv.weight"];
  const double bound = 1 / std::sqrt(6.);
  check_drawn(report, "conv.weight", "1 / sqrt(fan_in)", bound);
  const Tensor sums = convolve("reference", w, x, 3, kHalve);
  Array right = sums->value;
  for (std::size_t i = 0; i < right.size(); ++i) {
    right[i] += b->value[i / 3];
    right[i] *= right[i] > 0 ? 1 : 0.01;
  }
  report.add("layer", {"y", {3, 1, 3}, y->value, right});
  layer("up", x, 5, kDouble);
  report.add("layer, transposed, up.weight: its numbers", weights["up.weight"]->size(), 40);
  layer("wide", x, 200, kHalve);
  check_drawn(report, "wide.bias", "1 / sqrt(fan_in), fan_in that of its weight", bound);
  layer("wide_up", x, 200, kDouble);
  check_drawn(report, "wide_up.weight", "1 / sqrt(fan_in), transposed: outputs times taps",
              1 / std::sqrt(800.));
  check_drawn(report, "wide_up.bias", "1 / sqrt(fan_in), fan_in that of its weight", 1 / std::sqrt(800.));
  layer("conv", x, 3, kHalve);
  report.add("layer, asked a second time: weights in all", double(weights.size()), 8);
}
#elif LESSON == 11
// One training step of new weights beside the formula: Adam's m, which has a tenth of the gradient, and the
// moves. `truths`: the factor by which truths and so the gradient are larger.
void check_step(Report& report, const std::string& what, double truths, int step) {
  weights.clear(), tape.clear(), bits.seed(1);
  std::vector<Example> batch{touch(), touch()};
  for (Example& e : batch)
    for (double& t : e.truth) t *= truths;
  double loss = 0, squares = 0;
  for (const Example& e : batch) {
    const Tensor l = draw(e).loss;
    loss += l->value[0] / 2;
    backward(l);
  }
  std::map<std::string, Node> before;
  for (auto& [name, w] : weights) {
    Node& kept = before.emplace(name, *w).first->second;
    for (double& g : kept.grad) g /= 2, squares += g * g;
    std::fill(w->grad.begin(), w->grad.end(), 0);
  }
  const double length = std::sqrt(squares), rate = 2e-3 * std::min(1.0, step / 50.0);
  report.add(what + ", the loss of a batch", train_step(batch, step), loss);
  Compared m{"Adam's m of all weights"},
      moves{"what a rate of " + std::to_string(rate) + " takes off all weights"};
  for (const auto& [name, kept] : before) {
    const Node& mine = *weights[name];
    Node right = kept;
    adam(right, std::min(1.0, 1 / length), rate, step);
    for (std::size_t i = 0; i < right.value.size(); ++i) {
      m.yours.push_back(mine.m[i]), m.right.push_back(right.m[i]);
      moves.yours.push_back(kept.value[i] - mine.value[i]);
      moves.right.push_back(kept.value[i] - right.value[i]);
    }
  }
  m.shape = moves.shape = {int(m.right.size())};
  report.add(what, m, "the formula gives");
  report.add(what, moves, "the formula gives");
}

void check(Report& report) {
  const Tensor x = tensor({kMaps, 4, 4});
  for (double& at : x->value) at = 2 * uniform() - 1;
  const Tensor mine = attended("block.", x);
  const Tensor h = layer("block.conv.1", layer("block.conv.0", x, kMaps, kSame, relu), kMaps, kSame);
  const Tensor s = layer("block.attention.squeeze", channel_mean(h), kMaps / 4, kOne, relu);
  const Tensor right = each(*x, {x, h, layer("block.attention.expand", s, kMaps, kOne, sigmoid)}, gated);
  report.add("attended", {"y", {kMaps, 4, 4}, mine->value, right->value});
  check_step(report, "train_step 1, a gradient longer than 1", 10, 1);
  check_step(report, "train_step 60, a gradient shorter than 1", 1, 60);
  if (report.wrong() > 0) return;
  weights.clear(), tape.clear(), bits.seed(1);
  double first = 0, last = 0;
  for (int step = 1; step <= 60; ++step) {
    std::vector<Example> batch(2);
    for (Example& e : batch) e = touch();
    const double loss = train_step(batch, step);
    (step <= 10 ? first : last) += step <= 10 || step > 50 ? loss / 10 : 0;
  }
  std::printf("  the loss of ten steps: %.3f at first, %.3f after 50 steps\n", first, last);
  report.add("train_step, is the loss lower after 50 steps", last < 0.8 * first ? 1 : 0, 1);
  double grads = 0;
  for (const auto& [name, w] : weights)
    for (const double g : w->grad) grads += std::abs(g);
  report.add("train_step, gradients that are left afterwards", grads, 0);
}
#else
void check(Report& report) {
  report.add("failure 13, a spike: clip_factor(1e8, 1)", clip_factor(1e8, 1), 1e-8);
  report.add("failure 13, an ordinary gradient: clip_factor(0.5, 1)", clip_factor(0.5, 1), 1);
  report.add("failure 3, log_var has run away: clamp_gradient(200, 3)", clamp_gradient(200, 3), 0);
  report.add("failure 3, on the limit it must come back: clamp_gradient(10, 3)", clamp_gradient(10, 3), 3);
  report.add("failure 3, an ordinary one: clamp_gradient(2, 3)", clamp_gradient(2, 3), 3);
  std::vector<float> level;
  for (int i = 0; i < 49; ++i) level.push_back(200 + 0.125F * float(i % 2));
  const double found = double(variance(level)), right = 0.00390462309;
  report.add("failure 7, variance of 49 pixels at level 200", std::abs(found - right) < 1e-7 ? right : found,
             right);
  report.add("failure 11, half a second of silence: may_follow(1, 1.5, 0.05)", may_follow(1, 1.5, 0.05), 0);
  report.add("failure 11, the next frame: may_follow(1, 1.003, 0.05)", may_follow(1, 1.003, 0.05), 1);
}
#endif

}  // namespace

int main() {
  lessons::name_aborts("lesson " NAME);
  std::puts("lesson " NAME);
  Report report;
  check(report);
  std::puts(report.wrong() == 0 ? "  passed" : "  not yet");
  return report.wrong() == 0 ? 0 : 1;
}
