#include "autograd/variable.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "autograd/record.h"
#include "autograd/trace.h"

namespace supertac {

using detail::Node;

static thread_local bool recording = true;
static thread_local std::uint64_t last_number = 0;

Variable::Variable(Tensor value, bool requires_grad) {
  if (!value.defined()) throw std::invalid_argument("Variable: the tensor is undefined");
  node_ = detail::new_node();
  node_->value = std::move(value);
  node_->requires_grad = requires_grad;
}

Node& Variable::checked() const {
  if (node_ == nullptr) throw std::invalid_argument("Variable: used before it was given a value");
  return *node_;
}

void Variable::drop_grad() {
  Node& node = checked();
  if (node.grad.defined()) node.spare = std::move(node.grad);
}

std::pair<Variable, detail::ReverseStep*> make_result(const char* op, Tensor y,
                                                      std::span<const Variable* const> inputs,
                                                      const OpSettings* settings) {
  Variable result(std::move(y));
  Node& node = *result.node();
  node.op = op;
  Trace::note(op, result, inputs, settings);
  const bool needed = recording && std::any_of(inputs.begin(), inputs.end(),
                                               [](const Variable* x) { return x->requires_grad(); });
  if (!needed) return {std::move(result), nullptr};
  if (inputs.size() > kMaxInputs) {
    throw std::invalid_argument(std::string(op) + ": at most " + std::to_string(kMaxInputs) +
                                " inputs, got " + std::to_string(inputs.size()));
  }
  node.requires_grad = true;
  for (const Variable* x : inputs) {
    last_number = std::max(last_number, x->node()->number);  // one of a thread that has counted further
    detail::retain(x->node());
    node.inputs[node.input_count++] = x->node();
  }
  node.number = ++last_number;
  return {std::move(result), &node.step};
}

std::vector<Variable> inputs_of(const Variable& y) {
  const Node& node = y.checked();
  std::vector<Variable> inputs(node.input_count);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i].node_ = node.inputs[i];
    detail::retain(inputs[i].node_);
  }
  return inputs;
}

std::vector<Variable> history_of(const Variable& y) {
  std::vector<Variable> history{y};
  std::unordered_set<const Node*> known{y.node()};
  for (std::size_t i = 0; i < history.size(); ++i) {
    for (const Variable& x : inputs_of(history[i])) {
      if (known.insert(x.node()).second) history.push_back(x);
    }
  }
  std::stable_sort(history.begin(), history.end(),
                   [](const Variable& a, const Variable& b) { return a.node()->number < b.node()->number; });
  return history;
}

NoGrad::NoGrad() : before_(std::exchange(recording, false)) {}
NoGrad::~NoGrad() { recording = before_; }

}  // namespace supertac
