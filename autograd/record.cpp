// How ops become part of the graph, and how they refuse arguments.
#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "autograd/trace.h"

namespace supertac {

static thread_local bool recording = true;
static thread_local std::uint64_t last_number = 0;

bool is_recorded(std::span<const Variable* const> inputs) {
  return recording && std::ranges::any_of(inputs, [](const Variable* x) { return x->requires_grad(); });
}

Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs,
                     std::unique_ptr<detail::Node> node, const OpSettings* settings) {
  const bool recorded = node != nullptr;
  if (recorded && inputs.size() > kMaxInputs)
    refuse(op, "inputs", "at most " + std::to_string(kMaxInputs), std::to_string(inputs.size()));
  if (!recorded) node = std::make_unique<detail::Node>();
  Variable result(std::move(y), recorded, std::move(node));
  detail::Node& made = *result.node();
  made.op = op;
  Trace::note(op, result, inputs, settings);
  if (!recorded) return result;
  for (const Variable* x : inputs) {
    last_number = std::max(last_number, x->node()->number);  // one of a thread that has counted further
    detail::retain(x->node());
    made.inputs[made.input_count++] = x->node();
  }
  made.number = ++last_number;
  return result;
}

NoGrad::NoGrad() : before_(std::exchange(recording, false)) {}
NoGrad::~NoGrad() { recording = before_; }

void refuse(const std::string& op, const std::string& argument, const std::string& expected,
            const std::string& got) {
  throw std::invalid_argument(op + ": " + argument + " expects " + expected + ", got " + got);
}

std::string digits(double number, int count) {
  char text[32];
  return {text, static_cast<std::size_t>(std::snprintf(text, sizeof text, "%.*g", count, number))};
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

void check_between(const char* op, const char* argument, Dim value, Dim least, Dim most) {
  if (value < least || value > most)
    refuse(op, argument, std::to_string(least) + " to " + std::to_string(most), std::to_string(value));
}

}  // namespace supertac
