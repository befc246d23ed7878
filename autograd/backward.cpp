// backward(): the chain rule, and where reverse steps find the gradients that they add to.
#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/trace.h"

namespace supertac {
using detail::Node;

Tensor* Backward::grad_of(std::size_t input) {
  Node& x = *node_.inputs[input];
  if (!x.requires_grad) return nullptr;
  if (slot_of(input).into == Into::overwrite) x.grad.fill(0);
  return &x.grad;
}

static void check_gradient(const Node& x) {
  if (x.grad.shape() == x.value.shape()) return;
  refuse("backward", std::string("the gradient of ") + x.op, x.value.shape().text(), x.grad.shape().text());
}

Slot Backward::slot_of(std::size_t input) {
  Node& x = *node_.inputs[input];
  if (!x.requires_grad) return {};
  if (x.grad.defined()) {
    check_gradient(x);
    return {x.grad.data(), Into::add};
  }
  x.grad =
      x.spare.shape() == x.value.shape() && x.spare.defined() ? std::move(x.spare) : Tensor(x.value.shape());
  return {x.grad.data(), Into::overwrite};
}

static thread_local ReverseWatch* reverse_watch = nullptr;

ReverseWatch::ReverseWatch() {
  if (reverse_watch != nullptr) throw std::logic_error("ReverseWatch: this thread is watched already");
  reverse_watch = this;
}
ReverseWatch::~ReverseWatch() { reverse_watch = nullptr; }

namespace {

void check_not_freed(const Node& node) {
  if (node.freed)
    refuse("backward", node.op, "its graph",
           "one that an earlier backward freed; run the forward pass again");
}

void check_loss(const Variable& loss) {
  if (loss.size() != 1) refuse("backward", "loss", "one element", loss.shape().text());
  check_not_freed(*loss.node());
  if (!loss.requires_grad())
    refuse("backward", "loss", "to depend on a variable that requires a gradient",
           "one that depends on none");
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
  check_not_freed(node);
  Backward b(node);
  if (reverse_watch != nullptr) {
    reverse_watch->reverse(b, [&] { node.step(b); });
  } else {
    node.step(b);
  }
  for (std::size_t i = 0; i < node.input_count; ++i) {
    Node* input = node.inputs[i];
    const bool leaf = input->input_count == 0 && !input->freed;
    if (!leaf && input->requires_grad && input->grad.defined()) queue.add(input);
  }
  node.grad = Tensor();
  node.freed = true;
  detail::forget_inputs(node);
}

}  // namespace

void backward(const Variable& loss) {
  check_loss(loss);
  Tensor& grad = loss.node()->grad;
  if (!grad.defined()) grad = Tensor::zeros(loss.shape());
  check_gradient(*loss.node());
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
