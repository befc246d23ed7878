// backward(), and what it and the handles leave behind: nodes are deleted here.
#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/pool.h"
#include "autograd/reverse_watch.h"
#include "autograd/variable.h"

namespace supertac {
namespace detail {
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

}  // namespace

Node* new_node() { return new (pool_allocate(sizeof(Node))) Node; }

void retain(Node* node) noexcept {
  if (node != nullptr) node->users.fetch_add(1, std::memory_order_relaxed);
}

void release(Node* node) noexcept {
  if (drop(node)) delete_all(node);
}

}  // namespace detail

using detail::Node;

static thread_local ReverseWatch* reverse_watch = nullptr;

ReverseWatch::ReverseWatch() {
  if (reverse_watch != nullptr) throw std::logic_error("ReverseWatch: this thread is watched already");
  reverse_watch = this;
}
ReverseWatch::~ReverseWatch() { reverse_watch = nullptr; }

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

// The nodes that a gradient has reached, each once; the last one made comes first.
class Queue {
 public:
  explicit Queue(std::vector<Node*>& memory) : nodes_(memory) { nodes_.clear(); }
  ~Queue() {
    while (Node* node = take()) detail::release(node);
  }
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  void add(Node* node) {
    if (node->pending) return;
    nodes_.push_back(node);
    node->pending = true;
    detail::retain(node);
    std::push_heap(nodes_.begin(), nodes_.end(), older);
  }
  Node* take() {
    if (nodes_.empty()) return nullptr;
    std::pop_heap(nodes_.begin(), nodes_.end(), older);
    Node* node = nodes_.back();
    nodes_.pop_back();
    node->pending = false;
    return node;
  }

 private:
  static bool older(const Node* a, const Node* b) { return a->number < b->number; }
  std::vector<Node*>& nodes_;
};

// Runs one node's reverse step and queues the inputs it has reached.
void visit(Node& node, Queue& queue) {
  if (node.freed) {
    throw std::invalid_argument(
        std::string("backward: ") + node.op +
        " belongs to a graph that an earlier backward freed; run the forward pass again");
  }
  Backward b(node);
  if (reverse_watch != nullptr) {
    reverse_watch->reverse(node.op, node.input_count, b, [&] { node.step(b); });
  } else {
    node.step(b);
  }
  for (std::size_t i = 0; i < node.input_count; ++i) {
    Node* input = node.inputs[i];
    const bool leaf = input->input_count == 0 && !input->freed;
    if (!leaf && input->requires_grad && input->grad.defined()) queue.add(input);
  }
  Node* dead = nullptr;
  detail::forget_inputs(node, dead);
  node.grad = Tensor();
  node.freed = true;
  detail::delete_all(dead);
}

}  // namespace

void backward(const Variable& loss) {
  check_loss(loss);
  Tensor& grad = loss.node()->grad;
  if (!grad.defined()) grad = Tensor::zeros(loss.shape());
  grad.data()[0] += 1;                        // dL/dL
  if (loss.node()->input_count == 0) return;  // a leaf
  thread_local std::vector<Node*> memory;     // kept from step to step
  Queue queue(memory);
  queue.add(loss.node());
  while (Node* node = queue.take()) {
    const std::unique_ptr<Node, decltype(&detail::release)> held(node, &detail::release);
    visit(*node, queue);
  }
}

}  // namespace supertac
