// Trace: notes which ops ran, on what and with which settings, for those who compute the same in another way
// (models/inference/prepared/prepared.h) or let others do so (models/training/opened_step.h).
#pragma once

#include <chrono>
#include <span>
#include <string_view>
#include <vector>

#include "autograd/kernels/conv.h"
#include "autograd/variable.h"

namespace supertac {

/// What an op was told besides its inputs; each op gives record() what it has.
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
  double us = 0;  ///< since the op before was noted: its time, where nothing else is done between ops
};

/// While one lives, the ops of this thread are noted in their order. One at a time.
class Trace {
 public:
  Trace();
  virtual ~Trace();
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  const std::vector<TracedOp>& ops() const { return ops_; }

  /// For record(): `y` was made.
  static void note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                   const OpSettings* settings);

 protected:
  /// An op was noted, whose gradient nobody has asked for yet.
  virtual void noted(TracedOp&) {}

 private:
  std::vector<TracedOp> ops_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace supertac
