// How ops become part of the graph and of a trace, and how they refuse arguments.
#include <algorithm>
#include <stdexcept>

#include "autograd/trace.h"

namespace supertac {

static thread_local bool recording = true;
static thread_local std::uint64_t last_number = 0;

std::pair<Variable, detail::ReverseStep*> make_result(const char* op, Tensor y,
                                                      std::span<const Variable* const> inputs,
                                                      const OpSettings* settings) {
  Variable result(std::move(y));
  detail::Node& node = *result.node();
  node.op = op;
  Trace::note(op, result, inputs, settings);
  const bool needed = recording && std::any_of(inputs.begin(), inputs.end(),
                                               [](const Variable* x) { return x->requires_grad(); });
  if (!needed) return {std::move(result), nullptr};
  if (inputs.size() > kMaxInputs)
    refuse(op, "inputs", "at most " + std::to_string(kMaxInputs), std::to_string(inputs.size()));
  node.requires_grad = true;
  for (const Variable* x : inputs) {
    last_number = std::max(last_number, x->node()->number);  // one of a thread that has counted further
    detail::retain(x->node());
    node.inputs[node.input_count++] = x->node();
  }
  node.number = ++last_number;
  return {std::move(result), &node.step};
}

static thread_local Trace* current = nullptr;

Trace::Trace() {
  if (current != nullptr) throw std::logic_error("Trace: this thread is traced already");
  current = this;
}

Trace::~Trace() { current = nullptr; }

void Trace::note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                 const OpSettings* settings) {
  if (current == nullptr) return;
  TracedOp& traced =
      current->ops_.emplace_back(TracedOp{op, y, {}, settings != nullptr ? *settings : OpSettings{}});
  for (const Variable* x : inputs) traced.inputs.push_back(*x);
}

NoGrad::NoGrad() : before_(std::exchange(recording, false)) {}
NoGrad::~NoGrad() { recording = before_; }

void refuse(const std::string& op, const std::string& argument, const std::string& expected,
            const std::string& got) {
  throw std::invalid_argument(op + ": " + argument + " expects " + expected + ", got " + got);
}

void check_defined(const char* op, const char* argument, const Variable& x) {
  if (!x.defined()) refuse(op, argument, "a value", "an empty Variable");
}

void check_rank(const char* op, const char* argument, const Variable& x, int rank) {
  check_defined(op, argument, x);
  if (x.rank() != rank) refuse(op, argument, "rank " + std::to_string(rank), x.shape().text());
}

void check_shape(const char* op, const char* argument, const Variable& x, const Shape& expected) {
  check_defined(op, argument, x);
  if (x.shape() != expected) refuse(op, argument, expected.text(), x.shape().text());
}

void check_same_shape(const char* op, const char* a_name, const Variable& a, const char* b_name,
                      const Variable& b) {
  check_defined(op, a_name, a);
  check_defined(op, b_name, b);
  if (a.shape() == b.shape()) return;
  refuse(op, b_name, std::string("the shape of ") + a_name + ", " + a.shape().text(), b.shape().text());
}

void check_at_least(const char* op, const char* argument, Dim value, Dim least) {
  if (value < least) refuse(op, argument, std::to_string(least) + " or more", std::to_string(value));
}

}  // namespace supertac
