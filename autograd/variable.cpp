// Variables, their nodes, the trace of the ops that made them, and how ops refuse arguments.
#include "autograd/variable.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "autograd/kernels/fast/pool.h"
#include "autograd/trace.h"

namespace supertac {

// Nodes: how they are made, and deleted when nobody holds them any more.
namespace detail {
namespace {

bool drop(Node* node) { return node != nullptr && node->users.fetch_sub(1, std::memory_order_acq_rel) == 1; }

// Inputs that nobody else holds are put on `dead`.
void forget_inputs(Node& node, Node*& dead) {
  node.step.reset();
  for (std::size_t i = 0; i < node.input_count; ++i) {
    Node* input = std::exchange(node.inputs[i], nullptr);
    if (drop(input)) {
      input->next_to_delete = dead;
      dead = input;
    }
  }
  node.input_count = 0;
}

// A chain of nodes is deleted in a loop: a destructor that deletes its inputs would recurse as deep as the
// graph.
void delete_all(Node* dead) {
  while (dead != nullptr) {
    Node* node = dead;
    dead = node->next_to_delete;
    forget_inputs(*node, dead);
    node->~Node();
    pool_release(node, sizeof(Node));
  }
}

}  // namespace

void forget_inputs(Node& node) noexcept {
  Node* dead = nullptr;
  forget_inputs(node, dead);
  delete_all(dead);
}

Node* new_node() { return new (pool_allocate(sizeof(Node))) Node; }

void retain(Node* node) noexcept {
  if (node != nullptr) node->users.fetch_add(1, std::memory_order_relaxed);
}

void release(Node* node) noexcept {
  if (drop(node)) delete_all(node);
}

}  // namespace detail

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

void refuse(const char* op, const std::string& message) {
  throw std::invalid_argument(std::string(op) + ": " + message);
}

void check_defined(const char* op, const char* argument, const Variable& x) {
  if (!x.defined()) refuse(op, std::string(argument) + " expects a value, got an empty Variable");
}

void check_rank(const char* op, const char* argument, const Variable& x, int rank) {
  check_defined(op, argument, x);
  if (x.rank() == rank) return;
  refuse(op, std::string(argument) + " expects rank " + std::to_string(rank) + ", got " + x.shape().text());
}

void check_shape(const char* op, const char* argument, const Variable& x, const Shape& expected) {
  check_defined(op, argument, x);
  if (x.shape() == expected) return;
  refuse(op, std::string(argument) + " expects " + expected.text() + ", got " + x.shape().text());
}

void check_same_shape(const char* op, const char* a_name, const Variable& a, const char* b_name,
                      const Variable& b) {
  check_defined(op, a_name, a);
  check_defined(op, b_name, b);
  if (a.shape() == b.shape()) return;
  refuse(op, std::string(a_name) + " and " + b_name + " must have the same shape, got " + a.shape().text() +
                 " and " + b.shape().text());
}

}  // namespace supertac
