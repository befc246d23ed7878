#include "autograd/optimisers/adam.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <numbers>
#include <numeric>

#include "autograd/kernels/conv.h"
#include "autograd/kernels/fast/each.h"
#include "autograd/record.h"

namespace supertac {
namespace {

// rest = 1 - beta, rounded once: 1 - 0.999f is off by 1e-5, and the bias correction would not know.
struct Update {
  real clip, b1, rest1, b2, rest2, rate, correction, epsilon;
};

// The moments of a parameter without gradient would end as denormal numbers and stay there, since 0.9 times
// the smallest rounds back to it; arithmetic with them is 25 times slower. Epsilon hides 1e-30 by far.
inline real flushed(real x) { return std::abs(x) < real(1e-30) ? real(0) : x; }

void update(Dim n, Update u, const real* gradient, real* x, real* m, real* v) {
  kernels::each(n, [=](Dim i) {
    const real g = u.clip * gradient[i];
    m[i] = flushed(u.b1 * m[i] + u.rest1 * g);
    v[i] = flushed(u.b2 * v[i] + u.rest2 * g * g);
    x[i] -= u.rate * m[i] / (std::sqrt(v[i]) * u.correction + u.epsilon);
  });
}

double sum_of_squares(Dim n, const real* x) {
  return kernels::sum_of(n, [=](Dim i) { return static_cast<double>(x[i]) * static_cast<double>(x[i]); });
}

// The last bits of the C library's pow depend on the processor; products do not.
double power(double base, std::int64_t exponent) {
  double result = 1;
  for (; exponent > 0; exponent /= 2, base *= base)
    if (exponent % 2 == 1) result *= base;
  return result;
}

}  // namespace

Adam::Adam(std::vector<Variable> parameters, const AdamOptions& options)
    : parameters_(std::move(parameters)), options_(options) {
  const auto require = [](bool holds, const char* option, const char* expected, double got) {
    if (!holds) refuse("Adam", option, expected, digits(got));
  };
  const auto in_unit = [](double beta) { return beta >= 0 && beta < 1; };
  require(options.learning_rate >= 0, "learning_rate", "0 or more", options.learning_rate);
  require(in_unit(options.beta1), "beta1", "a number in [0,1)", options.beta1);
  require(in_unit(options.beta2), "beta2", "a number in [0,1)", options.beta2);
  require(options.epsilon > 0, "epsilon", "more than 0", options.epsilon);
  require(options.clip_norm >= 0, "clip_norm", "0 or more", options.clip_norm);
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    Variable& p = parameters_[k];
    if (!p.requires_grad())
      refuse("Adam", "parameter " + std::to_string(k), "a variable that requires a gradient", "a constant");
    (options.muon && is_matrix(p.shape()) ? matrices_ : others_).push_back(k);
    p.mutable_grad() = Tensor::zeros(p.shape());
    m_.push_back(Tensor::zeros(p.shape()));
    v_.push_back(Tensor::zeros(p.shape()));
  }
  squares_.resize(parameters_.size());
}

void Adam::zero_grad() {
  for (Variable& p : parameters_) p.mutable_grad().fill(0);
}

double Adam::step() {
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    const Variable& x = parameters_[k];
    if (!x.grad().defined() || x.grad().shape() != x.shape())
      refuse("Adam", "parameter " + std::to_string(k), "a gradient " + x.shape().text(),
             x.grad().text() + "; run backward() before step()");
  }
#pragma omp parallel for schedule(dynamic)
  for (std::size_t k = 0; k < parameters_.size(); ++k)
    squares_[k] = sum_of_squares(parameters_[k].size(), parameters_[k].grad().data());
  const double squares = std::accumulate(squares_.begin(), squares_.end(), 0.0);
  const double norm = std::sqrt(squares);
  if (!std::isfinite(norm)) return norm;
  const double factor = options_.clip_norm > 0 && norm > options_.clip_norm ? options_.clip_norm / norm : 1;
  // An infinite second moment would stop its parameter for ever.
  if (!std::isfinite(static_cast<real>(factor * factor * squares))) {
    return std::numeric_limits<double>::infinity();
  }
  ++steps_;
  const Update u{static_cast<real>(factor),
                 static_cast<real>(options_.beta1),
                 static_cast<real>(1 - options_.beta1),
                 static_cast<real>(options_.beta2),
                 static_cast<real>(1 - options_.beta2),
                 static_cast<real>(options_.learning_rate / (1 - power(options_.beta1, steps_))),
                 static_cast<real>(1 / std::sqrt(1 - power(options_.beta2, steps_))),
                 static_cast<real>(options_.epsilon)};
#pragma omp parallel for schedule(dynamic)
  for (const std::size_t k : others_) {
    Variable& p = parameters_[k];
    update(p.size(), u, p.grad().data(), p.mutable_value().data(), m_[k].data(), v_[k].data());
  }
  move_matrices(u.clip);
  return norm;
}

// The Taylor series, since the last bits of the C library's cosine depend on the processor. For |x| <= pi the
// first term left out is below 1e-19.
static double series_of_cosine(double x) {
  double sum = 1, term = 1;
  for (int k = 2; k <= 30; k += 2) sum += term *= -x * x / (k * (k - 1));
  return sum;
}

double Schedule::at(std::int64_t step) const {
  if (step < warm_up) return peak * static_cast<double>(step + 1) / static_cast<double>(warm_up);
  if (total <= warm_up) return peak;
  const double done =
      std::min(1.0, static_cast<double>(step - warm_up) / static_cast<double>(total - warm_up));
  return peak * (1 + series_of_cosine(std::numbers::pi * done)) / 2;
}

// Muon.

// With S = X X^T a step is X <- P X, P = a I + b S + c S^2, and S <- P S P, so that Q, the product of all P,
// is found without X.
void orthogonalise(Dim rows, Dim columns, real* x) {
  const Dim size = rows * columns, side = std::min(rows, columns), square = side * side;
  const bool wide = rows <= columns;
  constexpr real kA = real(3.4445), kB = real(-4.7750), kC = real(2.0315);
  Tensor start(Shape{size}), squares(Shape{5 * square});
  real* const from = start.data();
  real *s = squares.data(), *p = s + square, *q = p + square, *next = q + square, *spare = next + square;
  const auto factor = static_cast<real>(1 / (std::sqrt(sum_of_squares(size, x)) + 1e-7));
  kernels::each(size, [=](Dim i) { from[i] = factor * x[i]; });
  if (wide) {
    kernels::linear_grad_x(rows, rows, columns, from, from, {s, Into::overwrite});
  } else {
    kernels::linear_grad_w(rows, columns, columns, from, from, {s, Into::overwrite});
  }
  const auto multiply = [side](const real* a, const real* b, real* y) {
    kernels::linear(side, side, side, a, b, nullptr, 1, y);
  };
  constexpr int kSteps = 5;
  for (int step = 0; step < kSteps; ++step) {
    multiply(s, s, p);
    kernels::each(square, [=](Dim i) { p[i] = kB * s[i] + kC * p[i]; });
    for (Dim i = 0; i < side; ++i) p[i * side + i] += kA;
    if (step == 0) {
      std::copy_n(p, square, q);
    } else {
      multiply(q, p, next);
      std::swap(q, next);
    }
    if (step == kSteps - 1) break;
    multiply(p, s, spare);
    multiply(spare, p, s);
  }
  if (wide) {
    kernels::linear(rows, rows, columns, q, from, nullptr, 1, x);
  } else {
    kernels::linear(rows, columns, columns, from, q, nullptr, 1, x);
  }
}

bool is_matrix(const Shape& shape) {
  constexpr Dim kFewest = 8;
  if (shape.rank() < 2) return false;
  const Dim columns = shape[shape.rank() - 1];
  return columns >= kFewest && shape.elements() / columns >= kFewest;
}

static void move_matrix(const Shape& shape, real clip, double rate, const real* gradient, real* x, real* m) {
  constexpr real kMomentum = real(0.95), kRest = real(0.05);
  const Dim n = shape.elements(), columns = shape[shape.rank() - 1], rows = n / columns;
  Tensor direction(Shape{n});
  real* to = direction.data();
  kernels::each(n, [=](Dim i) {
    const real g = clip * gradient[i], moment = flushed(kMomentum * m[i] + kRest * g);
    m[i] = moment;
    to[i] = kMomentum * moment + kRest * g;  // Nesterov's
  });
  orthogonalise(rows, columns, to);
  const auto length =
      static_cast<real>(kMuonLength * rate * std::sqrt(static_cast<double>(std::max(rows, columns))));
  kernels::each(n, [=](Dim i) { x[i] += -length * to[i]; });
}

// By turns, so that a thread asks its pool for the same blocks in every step.
void Adam::move_matrices(real clip) {
  std::exception_ptr error;  // one that must not leave a thread: no memory
#pragma omp parallel for schedule(static, 1)
  for (const std::size_t k : matrices_) {
    Variable& p = parameters_[k];
    try {
      move_matrix(p.shape(), clip, options_.learning_rate, p.grad().data(), p.mutable_value().data(),
                  m_[k].data());
    } catch (...) {
#pragma omp critical
      error = std::current_exception();
    }
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace supertac
