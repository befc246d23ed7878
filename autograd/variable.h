// Variable: a tensor that knows how it was computed; backward() runs the chain rule.
//
// Every result of an op is a node with a creation number. A node owns its inputs, nothing owns it
// back, so dropping the loss drops the graph. backward() visits nodes in descending number, which is
// a valid reverse order of any program, without recursion, and frees each node's part of the graph
// as soon as its reverse step has run.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "autograd/node.h"
#include "autograd/tensor.h"

namespace supertac {

struct OpSettings;  // autograd/trace.h

/// A handle to one node of the graph (or to a leaf: a parameter or an input). What asks for the value or the
/// gradient of an empty handle throws std::invalid_argument.
class Variable {
 public:
  Variable() = default;
  /// A leaf that shares the buffer of `value`: clone() it to keep your own. With `requires_grad` backward()
  /// accumulates into grad(). Throws std::invalid_argument for an undefined tensor.
  explicit Variable(Tensor value, bool requires_grad = false);

  bool defined() const { return node_ != nullptr; }
  bool requires_grad() const { return defined() && node_->requires_grad; }
  /// The op that made it ("conv2d"), "leaf", or "none" for an empty handle.
  const char* op() const { return defined() ? node_->op : "none"; }

  const Tensor& value() const { return checked().value; }
  /// For optimisers, initialisers and loaders alone. A value that an op has read may not be written to before
  /// backward(): reverse steps read it again.
  Tensor& mutable_value() { return checked().value; }
  /// dL/dv of a leaf, empty until backward() has reached it; of an op's result empty again behind its reverse
  /// step.
  const Tensor& grad() const { return checked().grad; }
  /// To be replaced by one of value()'s shape, which backward() adds to, or by none, for which it writes a
  /// new one: backward() and Adam refuse another.
  Tensor& mutable_grad() { return checked().grad; }

  const Shape& shape() const { return value().shape(); }
  int rank() const { return value().rank(); }
  Dim dim(int i) const { return value().dim(i); }
  Dim size() const { return value().size(); }
  real item() const { return value().item(); }

  /// Tells variables apart: two handles of one variable have the same.
  detail::Node* node() const { return node_; }

  Variable(const Variable& other) noexcept : node_(other.node_) { detail::retain(node_); }
  Variable(Variable&& other) noexcept : node_(std::exchange(other.node_, nullptr)) {}
  Variable& operator=(Variable other) noexcept {
    std::swap(node_, other.node_);
    return *this;
  }
  ~Variable() { detail::release(node_); }

 private:
  friend std::vector<Variable> inputs_of(const Variable& y);
  friend Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs,
                              std::unique_ptr<detail::Node> node, const OpSettings* settings);
  Variable(Tensor value, bool requires_grad, std::unique_ptr<detail::Node> node);
  detail::Node& checked() const;
  detail::Node* node_ = nullptr;
};

/// Adds dL/dv into grad() of every leaf v that requires it, for a scalar L, and frees the graph.
/// Threads may build graphs over the same leaves at once, but only one may run backward() into a leaf.
/// Throws std::invalid_argument when L has not exactly one element, depends on nothing that requires a
/// gradient, or when a part of its graph was freed by an earlier backward(). What a reverse step throws comes
/// through, and leaves gradients half added: such a graph is of no more use.
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

/// The inputs of the op that made y; empty for a leaf, for what is not on a graph and behind backward(). For
/// looking into a graph when something has gone wrong.
std::vector<Variable> inputs_of(const Variable& y);

}  // namespace supertac
