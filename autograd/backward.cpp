// backward() is the chain rule; below it slot_of() finds the gradient that a reverse step adds to.
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "autograd/trace.h"

namespace supertac {
namespace {

using detail::Node;

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
    std::ranges::push_heap(nodes_, {}, &Node::number);
  }
  Node* take() {
    if (nodes_.empty()) return nullptr;
    std::ranges::pop_heap(nodes_, {}, &Node::number);
    Node* node = nodes_.back();
    nodes_.pop_back();
    node->pending = false;
    return node;
  }

 private:
  std::vector<Node*>& nodes_;
};

void check_not_freed(const Node& node) {
  if (node.freed)
    refuse("backward", "loss", "a graph that is whole",
           std::string("one whose op ") + node.op + " an earlier backward freed; run the forward pass again");
}

// Of the loss, or of that input of `reader`: a leaf has no name.
void check_gradient(const Node& x, const Node* reader = nullptr, std::size_t input = 0) {
  if (x.grad.shape() == x.value.shape()) return;
  const std::string whose = reader ? "input " + std::to_string(input) + " of " + reader->op : "loss";
  refuse("backward", "the gradient of " + whose, x.value.text(), x.grad.text());
}

// Runs one node's reverse step and queues the inputs it has reached.
void visit(Node& node, Queue& queue) {
  check_not_freed(node);
  Backward b(node);
  if (ReverseWatch* watch = ReverseWatch::of_this_thread()) {
    watch->reverse(b, [&] { node.reverse(b); });
  } else {
    node.reverse(b);
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
  if (loss.size() != 1) refuse("backward", "loss", "one element", loss.shape().text());
  Node& last = *loss.node();
  check_not_freed(last);
  if (!last.requires_grad)
    refuse("backward", "loss", "a variable that depends on one with a gradient", "one that depends on none");
  if (!last.grad.defined()) last.grad = Tensor::zeros(loss.shape());
  check_gradient(last);
  last.grad.data()[0] += 1;                // dL/dL
  if (last.input_count == 0) return;       // a leaf
  thread_local std::vector<Node*> memory;  // kept from step to step
  Queue queue(memory);
  queue.add(&last);
  while (Node* node = queue.take()) {
    const std::unique_ptr<Node, decltype(&detail::release)> held(node, &detail::release);
    visit(*node, queue);
  }
}

Slot Backward::slot_of(std::size_t input) {
  Node& x = *node_.inputs[input];
  if (!x.requires_grad) return {};
  if (x.grad.defined()) {
    check_gradient(x, &node_, input);
    return {x.grad.data(), Into::add};
  }
  x.grad = Tensor(x.value.shape());
  return {x.grad.data(), Into::overwrite};
}

}  // namespace supertac
