#include "autograd/gradient_checker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <sstream>

#include "autograd/record.h"

namespace supertac {
namespace {

Tensor weights_for(const Shape& shape) {
  Tensor r(shape);
  for (Dim i = 0; i < r.size(); ++i)
    r.data()[i] = static_cast<real>(0.5 + std::fmod(0.61803398875 * static_cast<double>(i + 1), 1.0)) *
                  (i % 3 == 1 ? -1 : 1);
  return r;
}

using Function = std::function<Variable()>;

double weighted_sum(const Function& f) {
  const NoGrad no_grad;
  const Variable y = f();
  const Tensor r = weights_for(y.shape());
  double total = 0;
  for (Dim i = 0; i < r.size(); ++i)
    total += static_cast<double>(y.value().data()[i]) * static_cast<double>(r.data()[i]);
  return total;
}

// The same as a node of its own, so that an op is checked by no other op.
Variable weighted(const Variable& y) {
  return record("weighted_sum", Tensor::zeros({}), {&y}, [](Backward& g) {
    const Tensor r = weights_for(g.value(0).shape());
    const Slot gy = g.slot_of(0);
    gy.begin(r.size());
    for (Dim i = 0; i < r.size(); ++i) gy.data[i] += g.gy().item() * r.data()[i];
  });
}

// (8 (f(+h) - f(-h)) - (f(+2h) - f(-2h))) / 12 h, exact to h^4
double derivative(const Function& f, Variable& leaf, Dim index, double step) {
  real& x = leaf.mutable_value().data()[index];
  const real original = x;
  const auto put_back = [original](real* to) { *to = original; };  // also when f throws
  const std::unique_ptr<real, decltype(put_back)> guard(&x, put_back);
  const double h = step * std::max(1.0, std::abs(static_cast<double>(original)));
  const auto at = [&](double offset) {
    x = static_cast<real>(static_cast<double>(original) + offset);
    return weighted_sum(f);
  };
  return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
}

bool far(double a, double b) { return std::abs(a - b) > 1e-7 * std::max(std::abs(a), std::abs(b)); }

// A rectifier's kink between the stencil's points spoils a difference, not the gradient: a wrong gradient
// stays wrong at a shorter step.
double nearest_derivative(const Function& f, Variable& leaf, Dim index, double step, double analytic) {
  double nearest = derivative(f, leaf, index, step);
  for (double h = step / 30; far(analytic, nearest) && h > step / 1e4; h /= 30) {
    const double shorter = derivative(f, leaf, index, h);
    if (std::abs(analytic - shorter) < std::abs(analytic - nearest)) nearest = shorter;
  }
  return nearest;
}

// NaN where it is not one; an entry whose numeric gradient alone is 0 has an infinite ratio.
double ratio_of_wrong(const std::vector<GradientEntry>& entries) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const GradientEntry& e : entries)
    if (e.relative_error > kGradientTolerance && std::abs(e.numeric) + std::abs(e.analytic) >= 1e-6)
      least = std::min(least, e.analytic / e.numeric), most = std::max(most, e.analytic / e.numeric);
  return most - least < 1e-3 ? (most + least) / 2 : std::numeric_limits<double>::quiet_NaN();
}

// "name [3,0,7] of [4,2,9]"
std::string place_of(const GradientEntry& e, const Shape& shape, const std::vector<std::string>& names) {
  std::array<Dim, kMaxRank> at{};
  Dim rest = e.index;
  for (int i = shape.rank() - 1; i >= 0; rest /= shape[i--])
    at[static_cast<std::size_t>(i)] = rest % shape[i];
  const std::string name = e.input < names.size() ? names[e.input] : "input " + std::to_string(e.input);
  return name + " " + Shape({at.data(), static_cast<std::size_t>(shape.rank())}).text() + " of " +
         shape.text();
}

}  // namespace

std::string GradientReport::text() const {
  std::ostringstream out;
  out.precision(10);
  if (entries == 0) return "no entries: the inputs are empty\n";
  out << wrong << " of " << entries << " entries (of " << elements << " elements) off by more than "
      << kGradientTolerance;
  if (std::isfinite(ratio)) out << ", analytic = " << std::round(1e3 * ratio) / 1e3 << " numeric in each";
  out << '\n';
  for (const GradientEntry& e : worst)
    out << e.place << ": analytic " << e.analytic << ", numeric " << e.numeric << ", relative error "
        << e.relative_error << (e.relative_error > kGradientTolerance ? "" : " (right)") << '\n';
  return out.str();
}

GradientReport check_gradients(const Function& f, std::vector<Variable> leaves,
                               const GradientCheckOptions& options) {
  for (Variable& leaf : leaves) leaf.mutable_grad() = Tensor();
  // Twice: the first gradient of a leaf is written, the second is added to it, by other code.
  constexpr int kTimes = 2;
  for (int i = 0; i < kTimes; ++i) backward(weighted(f()));

  GradientReport report;
  std::vector<double> largest(leaves.size());
  for (std::size_t k = 0; k < leaves.size(); ++k) {
    const Dim size = leaves[k].size(), count = std::min(size, options.max_entries_per_input);
    report.elements += size;
    const Tensor& grad = leaves[k].grad();
    for (Dim i = 0; i < count; ++i) {
      const Dim index = i * size / count;
      const double analytic = grad.defined() ? static_cast<double>(grad.data()[index]) / kTimes : 0;
      const double numeric = nearest_derivative(f, leaves[k], index, options.step, analytic);
      report.worst.push_back({k, index, analytic, numeric, 0, {}});
      largest[k] = std::max(largest[k], std::abs(numeric));
    }
  }
  report.entries = static_cast<Dim>(report.worst.size());
  if (report.worst.empty()) return report;
  const double largest_of_all = *std::max_element(largest.begin(), largest.end());
  for (GradientEntry& e : report.worst) {
    const double scale =
        std::max(std::abs(e.analytic), std::abs(e.numeric)) + 1e-3 * largest[e.input] + 1e-5 * largest_of_all;
    e.relative_error = std::abs(e.analytic - e.numeric) / std::max(scale, 1e-10);
    if (!std::isfinite(e.relative_error)) e.relative_error = 1e30;
    report.wrong += e.relative_error > kGradientTolerance;
    e.place = place_of(e, leaves[e.input].shape(), options.names);
  }
  report.ratio = ratio_of_wrong(report.worst);
  std::sort(report.worst.begin(), report.worst.end(), [](const GradientEntry& a, const GradientEntry& b) {
    return a.relative_error > b.relative_error;
  });
  report.max_relative_error = report.worst.front().relative_error;
  if (report.worst.size() > 10) report.worst.resize(10);
  return report;
}

}  // namespace supertac
