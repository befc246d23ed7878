// Trace: records which ops ran, with which inputs and settings. CompiledModel networks are built from it
// (models/inference/compiled/compiled_model.h), opened training steps list it
// (models/training/audit/opened_step.h).
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "autograd/kernels/conv.h"
#include "autograd/variable.h"

namespace supertac {

/// The settings of an op besides its inputs; each op fills in those that it has.
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
  virtual ~Trace();
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  const std::vector<TracedOp>& ops() const { return ops_; }

  /// Called by record() when `y` was computed.
  static void note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                   const OpSettings* settings);

 protected:
  /// Called for each op before anything uses its result, which may be changed here.
  virtual void noted(TracedOp&) {}

 private:
  std::vector<TracedOp> ops_;
};

}  // namespace supertac
