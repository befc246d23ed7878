// For the sources of ops: record() makes an op's result a node of the graph, and Backward is what its reverse
// step works on.
#pragma once

#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "autograd/node.h"
#include "autograd/variable.h"

namespace supertac {

/// What a reverse step sees: dL/dy, the inputs' values, and where to add dL/dx.
class Backward {
 public:
  explicit Backward(detail::Node& node) : node_(node) {}
  /// The node of y.
  const detail::Node& node() const { return node_; }
  const Tensor& gy() const { return node_.grad; }
  const Tensor& y() const { return node_.value; }
  /// As it is now: who writes to an input between its forward pass and backward() gets another gradient, and
  /// nothing notices.
  const Tensor& value(std::size_t input) const { return node_.inputs[input]->value; }
  /// Where to leave the gradient of that input; empty when it requires none. At first use the contents are
  /// undefined and all of them must be written; a step that adds to an element more than once (sums, maxima)
  /// has Slot::begin() fill them with zeros. A step asks for its slots in the order of the inputs.
  Slot slot_of(std::size_t input);
  /// dL/dy to be changed in place: this step is its only reader.
  Tensor& mutable_gy() { return node_.grad; }

 private:
  detail::Node& node_;
};

/// Whether the result of an op is put onto the graph: recording is on, and an input needs a gradient.
bool is_recorded(std::span<const Variable* const> inputs);
/// For record() only: makes y the value of `node`, or a leaf where that is null. Throws std::invalid_argument
/// for more than kMaxInputs inputs of a node.
Variable make_result(const char* op, Tensor y, std::span<const Variable* const> inputs,
                     std::unique_ptr<detail::Node> node, const OpSettings* settings);

/// Makes y a node of the graph. `step(Backward&)` is called by backward() with dL/dy at hand. `settings`:
/// those of the op, for a Trace.
template <class Step>
Variable record(const char* op, Tensor y, std::span<const Variable* const> inputs, Step&& step,
                const OpSettings* settings = nullptr) {
  std::unique_ptr<detail::Node> node;
  if (is_recorded(inputs))
    node = std::make_unique<detail::OpNode<std::decay_t<Step>>>(std::forward<Step>(step));
  return make_result(op, std::move(y), inputs, std::move(node), settings);
}
template <class Step>
Variable record(const char* op, Tensor y, std::initializer_list<const Variable*> inputs, Step&& step,
                const OpSettings* settings = nullptr) {
  return record(op, std::move(y), std::span(inputs.begin(), inputs.size()), std::forward<Step>(step),
                settings);
}

/// Throws std::invalid_argument "op: argument expects EXPECTED, got GOT", as every op refuses an argument:
/// "conv2d: x expects rank 4, got [2,3]". The checks below do so; those of shapes refuse an empty Variable as
/// well.
[[noreturn]] void refuse(const std::string& op, const std::string& argument, const std::string& expected,
                         const std::string& got);
/// So many digits of a number; with nine, as refuse() is given it, two floats that differ read differently.
std::string digits(double number, int count = 9);
void check_defined(const char* op, const char* argument, const Variable& x);
void check_rank(const char* op, const char* argument, const Variable& x, int rank);
void check_shape(const char* op, const char* argument, const Variable& x, const Shape& expected);
void check_same_shape(const char* op, const char* a_name, const Variable& a, const char* b_name,
                      const Variable& b);
void check_at_least(const char* op, const char* argument, Dim value, Dim least);
void check_between(const char* op, const char* argument, Dim value, Dim least, Dim most);

}  // namespace supertac
