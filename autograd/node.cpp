// Nodes of the graph: how they are made, and deleted when nobody holds them any more.
#include "autograd/node.h"

#include <utility>

#include "autograd/kernels/fast/pool.h"

namespace supertac {
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

}  // namespace supertac
