#include "models/training/loss/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

namespace supertac {
namespace {

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
