// What stands behind a Variable: the nodes of the graph. Ops see them through Backward (record.h) alone.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "autograd/tensor.h"

namespace supertac {

class Backward;

/// The most inputs of an op.
inline constexpr std::size_t kMaxInputs = 8;

namespace detail {

/// A value, its gradient, and the inputs that it was computed from, which it owns.
struct Node {
  Node() = default;
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  virtual ~Node() = default;
  // The memory comes from the pool (autograd/kernels/fast/pool.h).
  static void* operator new(std::size_t bytes);
  static void operator delete(void* block, std::size_t bytes) noexcept;

  /// Adds dL/dx to the gradients of the inputs. A leaf has none.
  virtual void reverse(Backward&) {}
  /// Destroys what the reverse step holds.
  virtual void forget_step() noexcept {}

  std::atomic<std::int32_t> users{1};
  bool requires_grad = false;
  bool freed = false;    // its part of the graph is gone after backward()
  bool pending = false;  // waits in backward()'s queue
  std::uint64_t number = 0;
  const char* op = "leaf";
  Tensor value;
  Tensor grad;
  std::array<Node*, kMaxInputs> inputs{};
  std::size_t input_count = 0;
  Node* next_to_delete = nullptr;
};

/// The result of an op on the graph, with the reverse step that record() was given.
template <class Step>
struct OpNode : Node {
  explicit OpNode(Step s) : step(std::move(s)) {}
  void reverse(Backward& b) override { (*step)(b); }
  void forget_step() noexcept override { step.reset(); }
  std::optional<Step> step;
};

void retain(Node* node) noexcept;
void release(Node* node) noexcept;
/// Forgets how the node was computed, and deletes the inputs that nobody else holds.
void forget_inputs(Node& node) noexcept;

}  // namespace detail
}  // namespace supertac
