// Variable: a tensor that knows how it was computed; backward() runs the chain rule.
//
// Every result of an op is a node with a creation number. A node owns its inputs, nothing owns it
// back, so dropping the loss drops the graph. backward() visits nodes in descending number, which is
// a valid reverse order of any program, without recursion, and frees each node's part of the graph
// as soon as its reverse step has run.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <new>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "autograd/tensor.h"

namespace supertac {

class Backward;

namespace detail {

/// A reverse step kept inside the node: no heap allocation, moved never.
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
    reset();
    new (storage_) Step(std::forward<F>(f));
    call_ = [](void* step, Backward& b) { (*static_cast<Step*>(step))(b); };
    destroy_ = [](void* step) { static_cast<Step*>(step)->~Step(); };
  }
  void reset() {
    if (destroy_ != nullptr) destroy_(storage_);
    call_ = nullptr;
    destroy_ = nullptr;
  }
  explicit operator bool() const { return call_ != nullptr; }
  void operator()(Backward& b) { call_(storage_, b); }

 private:
  alignas(16) std::byte storage_[160];
  void (*call_)(void*, Backward&) = nullptr;
  void (*destroy_)(void*) = nullptr;
};

struct Node;
void retain(Node* node) noexcept;
void release(Node* node) noexcept;

}  // namespace detail

/// A handle to one node of the graph (or to a leaf: a parameter or an input).
class Variable {
 public:
  Variable() = default;
  /// A leaf. With `requires_grad` backward() accumulates into grad(). Throws std::invalid_argument for an
  /// undefined tensor.
  explicit Variable(Tensor value, bool requires_grad = false);

  Variable(const Variable& other) noexcept : node_(other.node_) { detail::retain(node_); }
  Variable(Variable&& other) noexcept : node_(std::exchange(other.node_, nullptr)) {}
  Variable& operator=(Variable other) noexcept {
    std::swap(node_, other.node_);
    return *this;
  }
  ~Variable() { detail::release(node_); }

  bool defined() const { return node_ != nullptr; }
  bool requires_grad() const;
  /// The op that made it ("conv2d"), or "leaf".
  const char* op() const;

  /// What has been recorded is const; only an optimiser, an initialiser or a loader writes, through this.
  Tensor& mutable_value();
  const Tensor& value() const;
  /// Empty until backward() has reached this variable.
  const Tensor& grad() const;
  Tensor& mutable_grad();
  /// Empties grad(). Its memory is kept for the next gradient, also where another Tensor still shows it:
  /// given to the pool it would go to what the next forward pass makes first, long after it has left the
  /// caches.
  void drop_grad();

  const Shape& shape() const { return value().shape(); }
  int rank() const { return value().rank(); }
  Dim dim(int i) const { return value().dim(i); }
  Dim size() const { return value().size(); }
  real item() const { return value().item(); }

  detail::Node* node() const { return node_; }

 private:
  friend Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs);
  friend std::vector<Variable> inputs_of(const Variable& y);
  detail::Node* node_ = nullptr;
};

inline constexpr std::size_t kMaxInputs = 8;

/// What a reverse step sees: dL/dy, the inputs' values, and where to add dL/dx.
class Backward {
 public:
  explicit Backward(detail::Node& node) : node_(node) {}
  const Tensor& gy() const;
  const Tensor& y() const;
  const Tensor& value(std::size_t input) const;
  /// The gradient of that input, zero-filled at first use; null when nobody asked for it. Add into it.
  Tensor* grad_of(std::size_t input);
  /// The same without the zeros: at first use the contents are undefined and the step must write all of them.
  struct Slot {
    Tensor* grad = nullptr;
    Into into = Into::add;
    explicit operator bool() const { return grad != nullptr; }
    real* data() const { return grad->data(); }
  };
  Slot slot_of(std::size_t input);
  /// dL/dy to be changed in place: this step is its only reader.
  Tensor& mutable_gy();

 private:
  detail::Node& node_;
};

/// The node of an op without its reverse step; used by record() only.
Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs);
/// Where record() puts the reverse step, or null when no input needs a gradient or recording is off.
detail::ReverseStep* reverse_step_of(const Variable& y);

/// Makes y a node of the graph. `step` is called by backward() with dL/dy at hand.
template <class Step>
Variable record(const char* op, Tensor y, std::initializer_list<const Variable*> inputs, Step&& step) {
  return record(op, std::move(y), std::span<const Variable* const>(inputs.begin(), inputs.size()),
                std::forward<Step>(step));
}
template <class Step>
Variable record(const char* op, Tensor y, std::span<const Variable* const> inputs, Step&& step) {
  Variable result = make_result(op, std::move(y), inputs);
  if (detail::ReverseStep* slot = reverse_step_of(result)) slot->set(std::forward<Step>(step));
  return result;
}

/// y and every value it was computed from, in the order of computation; leaves (inputs, parameters) come
/// first. What backward() has freed is missing. For looking into a graph when something has gone wrong.
std::vector<Variable> history_of(const Variable& y);
/// The inputs of the op that made y; empty for a leaf and for what is not on a graph.
std::vector<Variable> inputs_of(const Variable& y);

/// Adds dL/dv into grad() of every leaf v that requires it, for a scalar L, and frees the graph.
/// Throws std::invalid_argument when L is not a scalar, does not depend on a parameter, or when its
/// graph was freed by an earlier backward().
void backward(const Variable& loss);

/// While one lives on this thread, ops compute values only: the inference mode of the same code.
class NoGrad {
 public:
  NoGrad();
  ~NoGrad();
  NoGrad(const NoGrad&) = delete;
  NoGrad& operator=(const NoGrad&) = delete;

 private:
  bool before_;
};

}  // namespace supertac
