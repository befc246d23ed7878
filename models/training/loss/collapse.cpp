#include "models/training/loss/collapse.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

namespace supertac {
namespace {

constexpr double kLeastShare = 0.02, kLargestShare = 10;  // of the truths' standard deviation
constexpr double kActiveVariance = 0.01;                  // Burda et al. 2016

bool finite(const Tensor& t) {
  return std::ranges::all_of(t.values(), [](real x) { return std::isfinite(x); });
}

// y and every value it was computed from, in the order of computation; leaves (inputs, parameters) come
// first.
std::vector<Variable> history_of(const Variable& y) {
  std::vector<Variable> history{y};
  std::unordered_set<const void*> known{y.node()};
  for (std::size_t i = 0; i < history.size(); ++i)
    for (const Variable& x : inputs_of(history[i]))
      if (known.insert(x.node()).second) history.push_back(x);
  std::ranges::stable_sort(history, {}, [](const Variable& v) { return v.node()->number; });
  return history;
}

const Parameter* parameter_of(const Variable& v, const std::vector<Parameter>& parameters) {
  const auto found =
      std::ranges::find(parameters, v.node(), [](const Parameter& p) { return p.value.node(); });
  return found == parameters.end() ? nullptr : &*found;
}

// " in encoder.0.fc" for an op with parameters, " behind encoder.0.fc" for one that follows it.
std::string place_of(const Variable& v, const std::vector<Parameter>& parameters) {
  const char* relation = " in ";
  for (Variable at = v; at.defined();) {
    Variable before;
    for (const Variable& x : inputs_of(at)) {
      if (const Parameter* p = parameter_of(x, parameters))
        return relation + p->name.substr(0, p->name.rfind('.'));
      if (!inputs_of(x).empty()) before = x;
    }
    at = before;
    relation = " behind ";
  }
  return {};
}

std::string describe_leaf(const Variable& leaf, const std::vector<Variable>& history,
                          const std::vector<Parameter>& parameters) {
  if (const Parameter* p = parameter_of(leaf, parameters)) return "parameter " + p->name + " is not finite";
  for (const Variable& user : history) {
    for (const Variable& x : inputs_of(user)) {
      if (x.node() != leaf.node()) continue;
      return std::string("an input of ") + user.op() + place_of(user, parameters) + " is not finite";
    }
  }
  return "an input is not finite";
}

}  // namespace

void BatchVariance::add(const Tensor& batch, std::size_t first) {
  const Dim samples = batch.dim(0), count = samples > 0 ? batch.size() / samples : 0;
  const real* x = batch.data();
  for (Dim n = 0; n < samples; ++n) {
    double *sum = &values[first], *squares = &values[entries() + first];
    for (Dim i = 0; i < count; ++i) {
      const auto value = static_cast<double>(*x++);
      sum[i] += value;
      squares[i] += value * value;
    }
  }
}

double BatchVariance::variance(std::size_t i, double samples) const {
  const double mean = values[i] / samples;
  return std::max(0.0, values[entries() + i] / samples - mean * mean);
}

double BatchVariance::mean_variance(double samples) const {
  double total = 0;
  for (std::size_t i = 0; i < entries(); ++i) total += variance(i, samples);
  return total / static_cast<double>(entries());
}

bool is_degenerate(const BatchVariance& pictures, const BatchVariance& truths, double samples) {
  const double own = pictures.mean_variance(samples), due = truths.mean_variance(samples);
  return own < kLeastShare * kLeastShare * due || (due > 0 && own > kLargestShare * kLargestShare * due);
}

int active_latents(const BatchVariance& means, double samples) {
  int active = 0;
  for (std::size_t i = 0; i < means.entries(); ++i) active += means.variance(i, samples) > kActiveVariance;
  return active;
}

std::string where_not_finite(const Variable& loss, const std::vector<Parameter>& parameters) {
  const std::vector<Variable> history = history_of(loss);
  for (const Variable& v : history) {
    if (finite(v.value())) continue;
    if (inputs_of(v).empty()) return describe_leaf(v, history, parameters);
    return std::string("the output of ") + v.op() + place_of(v, parameters) +
           " is the first that is not finite";
  }
  return {};
}

std::string gradient_not_finite(const std::vector<Parameter>& parameters) {
  const auto last = std::find_if(parameters.rbegin(), parameters.rend(), [](const Parameter& p) {
    return p.value.grad().defined() && !finite(p.value.grad());
  });
  return last == parameters.rend() ? "" : last->name;
}

}  // namespace supertac
