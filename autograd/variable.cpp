#include "autograd/variable.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <unordered_set>
#include <vector>

#include "autograd/pool.h"
#include "autograd/reverse_watch.h"
#include "autograd/trace.h"

namespace supertac {
namespace detail {

struct Node {
  std::atomic<std::int32_t> users{1};
  bool requires_grad = false;
  bool freed = false;    // its part of the graph is gone after backward()
  bool pending = false;  // waits in backward()'s queue
  std::uint64_t number = 0;
  const char* op = "leaf";
  Tensor value;
  Tensor grad;
  Tensor spare;  // the memory of a gradient that was dropped
  std::array<Node*, kMaxInputs> inputs{};
  std::size_t input_count = 0;
  ReverseStep step;
  Node* next_to_delete = nullptr;
};

void retain(Node* node) noexcept {
  if (node != nullptr) node->users.fetch_add(1, std::memory_order_relaxed);
}

namespace {

bool drop(Node* node) { return node != nullptr && node->users.fetch_sub(1, std::memory_order_acq_rel) == 1; }

// Forgets how the node was computed; inputs that nobody else holds are put on `dead`.
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

Node* new_node() { return new (pool_allocate(sizeof(Node))) Node; }

thread_local bool recording = true;
thread_local std::uint64_t last_number = 0;
thread_local ReverseWatch* reverse_watch = nullptr;

}  // namespace

void release(Node* node) noexcept {
  if (drop(node)) delete_all(node);
}

}  // namespace detail

using detail::Node;

Variable::Variable(Tensor value, bool requires_grad) {
  if (!value.defined()) throw std::invalid_argument("Variable: the tensor is undefined");
  node_ = detail::new_node();
  node_->value = std::move(value);
  node_->requires_grad = requires_grad;
}

bool Variable::requires_grad() const { return node_ != nullptr && node_->requires_grad; }
const char* Variable::op() const { return node_ != nullptr ? node_->op : "none"; }
Tensor& Variable::mutable_value() { return node_->value; }
const Tensor& Variable::value() const {
  if (node_ == nullptr) throw std::invalid_argument("Variable: used before it was given a value");
  return node_->value;
}
const Tensor& Variable::grad() const { return node_->grad; }
Tensor& Variable::mutable_grad() { return node_->grad; }
void Variable::drop_grad() {
  if (node_->grad.defined()) node_->spare = std::move(node_->grad);
}

const Tensor& Backward::gy() const { return node_.grad; }
const Tensor& Backward::y() const { return node_.value; }
const Tensor& Backward::value(std::size_t input) const { return node_.inputs[input]->value; }

Tensor* Backward::grad_of(std::size_t input) {
  Node& x = *node_.inputs[input];
  if (!x.requires_grad) return nullptr;
  if (const Slot slot = slot_of(input); slot.into == Into::overwrite) slot.grad->fill(0);
  return &x.grad;
}

Backward::Slot Backward::slot_of(std::size_t input) {
  Node& x = *node_.inputs[input];
  if (!x.requires_grad) return {};
  if (x.grad.defined()) return {&x.grad, Into::add};
  x.grad =
      x.spare.shape() == x.value.shape() && x.spare.defined() ? std::move(x.spare) : Tensor(x.value.shape());
  return {&x.grad, Into::overwrite};
}

Tensor& Backward::mutable_gy() { return node_.grad; }

Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs) {
  Variable result(std::move(y));
  Node& node = *result.node_;
  node.op = op;
  Trace::note(op, result, inputs);
  if (!detail::recording) return result;
  const bool needed =
      std::any_of(inputs.begin(), inputs.end(), [](const Variable* x) { return x->requires_grad(); });
  if (!needed) return result;
  if (inputs.size() > kMaxInputs) {
    throw std::invalid_argument(std::string(op) + ": at most " + std::to_string(kMaxInputs) +
                                " inputs, got " + std::to_string(inputs.size()));
  }
  node.requires_grad = true;
  // An input may come from a thread that has counted further.
  for (const Variable* x : inputs) detail::last_number = std::max(detail::last_number, x->node_->number);
  node.number = ++detail::last_number;
  for (const Variable* x : inputs) {
    detail::retain(x->node_);
    node.inputs[node.input_count++] = x->node_;
  }
  return result;
}

detail::ReverseStep* reverse_step_of(const Variable& y) {
  Node* node = y.node();
  return node->input_count > 0 ? &node->step : nullptr;
}

std::vector<Variable> inputs_of(const Variable& y) {
  std::vector<Variable> inputs(y.node()->input_count);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    inputs[i].node_ = y.node()->inputs[i];
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

namespace {

void check_loss(const Variable& loss) {
  if (loss.size() != 1) {
    throw std::invalid_argument("backward: the loss must be a scalar, shape is " + loss.shape().text());
  }
  if (loss.node()->freed) {
    throw std::invalid_argument(
        "backward: the graph of this loss was freed by an earlier backward; run the forward pass again");
  }
  if (!loss.requires_grad()) {
    throw std::invalid_argument(
        "backward: the loss does not depend on any variable that requires a gradient");
  }
}

bool older(const Node* a, const Node* b) { return a->number < b->number; }

// Runs one node's reverse step and queues the inputs it has reached.
void visit(Node& node, std::vector<Node*>& queue, Node*& dead) {
  if (node.freed) {
    throw std::invalid_argument(
        std::string("backward: ") + node.op +
        " belongs to a graph that an earlier backward freed; run the forward pass again");
  }
  Backward b(node);
  if (ReverseWatch* watch = ReverseWatch::current()) {
    watch->reverse(node.op, node.input_count, b, [&] { node.step(b); });
  } else {
    node.step(b);
  }
  for (std::size_t i = 0; i < node.input_count; ++i) {
    Node* input = node.inputs[i];
    if (input->pending || !input->requires_grad || !input->grad.defined()) continue;
    if (input->input_count == 0 && !input->freed) continue;  // a leaf
    input->pending = true;
    detail::retain(input);
    queue.push_back(input);
    std::push_heap(queue.begin(), queue.end(), older);
  }
  detail::forget_inputs(node, dead);
  node.grad = Tensor();
  node.freed = true;
}

}  // namespace

void backward(const Variable& loss) {
  check_loss(loss);
  thread_local std::vector<Node*> queue;
  Tensor& grad = loss.node()->grad;
  if (!grad.defined()) grad = Tensor::zeros(loss.shape());
  grad.data()[0] += 1;                        // dL/dL
  if (loss.node()->input_count == 0) return;  // a leaf
  queue.clear();
  queue.push_back(loss.node());
  detail::retain(loss.node());
  while (!queue.empty()) {
    std::pop_heap(queue.begin(), queue.end(), older);
    Node* node = queue.back();
    queue.pop_back();
    node->pending = false;
    Node* dead = nullptr;
    try {
      visit(*node, queue, dead);
    } catch (...) {
      for (Node* waiting : queue) {
        waiting->pending = false;
        detail::release(waiting);
      }
      queue.clear();
      detail::delete_all(dead);
      detail::release(node);
      throw;
    }
    detail::delete_all(dead);
    detail::release(node);
  }
}

ReverseWatch::ReverseWatch() {
  if (detail::reverse_watch != nullptr)
    throw std::logic_error("ReverseWatch: this thread is watched already");
  detail::reverse_watch = this;
}
ReverseWatch::~ReverseWatch() { detail::reverse_watch = nullptr; }
ReverseWatch* ReverseWatch::current() { return detail::reverse_watch; }

NoGrad::NoGrad() : before_(detail::recording) { detail::recording = false; }
NoGrad::~NoGrad() { detail::recording = before_; }

}  // namespace supertac
