// Variables and their nodes.
#include "autograd/variable.h"

#include <memory>
#include <utility>

#include "autograd/kernels/fast/pool.h"
#include "autograd/record.h"

namespace supertac {

// Nodes: how they are made, and deleted when nobody holds them any more.
namespace detail {
namespace {

bool drop(Node* node) { return node != nullptr && node->users.fetch_sub(1, std::memory_order_acq_rel) == 1; }

// Inputs that nobody else holds are put on `dead`.
void forget_inputs(Node& node, Node*& dead) {
  node.forget_step();
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
    delete node;
  }
}

}  // namespace

void forget_inputs(Node& node) noexcept {
  Node* dead = nullptr;
  forget_inputs(node, dead);
  delete_all(dead);
}

void* Node::operator new(std::size_t bytes) { return pool_allocate(bytes); }
void Node::operator delete(void* block, std::size_t bytes) noexcept { pool_release(block, bytes); }

void retain(Node* node) noexcept {
  if (node != nullptr) node->users.fetch_add(1, std::memory_order_relaxed);
}

void release(Node* node) noexcept {
  if (drop(node)) delete_all(node);
}

}  // namespace detail

using detail::Node;

Variable::Variable(Tensor value, bool requires_grad)
    : Variable(std::move(value), requires_grad, std::make_unique<Node>()) {}

Variable::Variable(Tensor value, bool requires_grad, std::unique_ptr<Node> node) {
  if (!value.defined()) refuse("Variable", "value", "a tensor", "an undefined one");
  node_ = node.release();
  node_->value = std::move(value);
  node_->requires_grad = requires_grad;
}

Node& Variable::checked() const {
  if (node_ == nullptr) refuse("Variable", "its value", "a tensor or an op's result", "an empty Variable");
  return *node_;
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

}  // namespace supertac
