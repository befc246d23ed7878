// What stands behind a Variable: the nodes of the graph. Whoever walks the graph itself needs it: ops do not.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>
#include <utility>

#include "autograd/tensor.h"

namespace supertac {

class Backward;

/// The most inputs of an op.
inline constexpr std::size_t kMaxInputs = 8;

namespace detail {

/// A reverse step kept inside the node: no heap allocation, set once, moved never.
class ReverseStep {
 public:
  ReverseStep() = default;
  ReverseStep(const ReverseStep&) = delete;
  ReverseStep& operator=(const ReverseStep&) = delete;
  ~ReverseStep() { reset(); }

  template <class F>
  void set(F&& f) {
    using Step = std::decay_t<F>;
    static_assert(sizeof(Step) <= sizeof(storage_), "a reverse step captures a few small values only");
    new (storage_) Step(std::forward<F>(f));
    call_ = [](void* storage, Backward* b) {
      Step& step = *static_cast<Step*>(storage);
      b != nullptr ? step(*b) : step.~Step();
    };
  }
  void reset() {
    if (call_ != nullptr) std::exchange(call_, nullptr)(storage_, nullptr);
  }
  void operator()(Backward& b) { call_(storage_, &b); }

 private:
  alignas(16) std::byte storage_[160];        // the largest: sizes and slope of a convolution
  void (*call_)(void*, Backward*) = nullptr;  // without a Backward it destroys the step
};

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

Node* new_node();
void retain(Node* node) noexcept;
void release(Node* node) noexcept;
/// Forgets how the node was computed, and deletes the inputs that nobody else holds.
void forget_inputs(Node& node) noexcept;

}  // namespace detail
}  // namespace supertac
