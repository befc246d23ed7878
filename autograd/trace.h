// A Trace records which ops ran, with which inputs and settings; compiled networks are built from it
// (models/inference/compiled/compiled_model.h). A ReverseWatch stands between backward() and the reverse
// steps. Opened training steps list both (models/training/audit/opened_step.h).
#pragma once

#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "autograd/kernels/conv.h"
#include "autograd/record.h"

namespace supertac {

/// The settings of an op besides its inputs, as far as a plan, an exporter or a referee of the op needs them.
struct OpSettings {
  kernels::ConvSettings conv{};      ///< convolutions
  real negative_slope = 1;           ///< convolutions, linear layers, relu and leaky_relu
  Dim first = 0, run = 0, step = 0;  ///< take_runs
  real factor = 1;                   ///< scale
  real low = 0, high = 0;            ///< clamp
  Tensor constant{};                 ///< sample_gaussian's noise, the target of ssim
};

struct TracedOp {
  std::string_view op;  ///< "conv2d"
  Variable y;
  std::vector<Variable> inputs;
  OpSettings settings;
};

/// While one lives, the ops of this thread are recorded in their order, under NoGrad too, and their values
/// stay in memory.
class Trace {
 public:
  /// Throws std::logic_error where this thread has one already.
  Trace();
  ~Trace();
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  const std::vector<TracedOp>& ops() const { return ops_; }

  /// Called by make_result() when `y` was computed.
  static void note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                   const OpSettings* settings);

 private:
  std::vector<TracedOp> ops_;
};

/// While one lives, backward() of this thread hands every reverse step to it. One at a time.
class ReverseWatch {
 public:
  /// Throws std::logic_error where this thread has one already.
  ReverseWatch();
  virtual ~ReverseWatch();
  ReverseWatch(const ReverseWatch&) = delete;
  ReverseWatch& operator=(const ReverseWatch&) = delete;

  /// Null where none lives.
  static ReverseWatch* of_this_thread();

  /// Must call `step`, which reads b.gy() and adds into the gradients of the op's inputs.
  virtual void reverse(Backward& b, const std::function<void()>& step) = 0;
};

}  // namespace supertac
