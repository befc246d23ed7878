// What `lessons` is made of. See ../README.md.
#pragma once

#include <string>
#include <vector>

#include "autograd/variable.h"
#include "docs/lessons/lessons.h"

namespace lessons {

using supertac::Tensor;
using supertac::Variable;

/// One line for each thing that was looked at; throws Wrong with the worst entry and both numbers.
struct Wrong {
  std::string text;
};
void check(int lesson);

/// Ops of the small network in whole.cpp: those of the project, or the reader's.
struct Ops {
  bool yours[9] = {};  ///< by lesson

  Variable linear(const Variable& x, const Variable& w, const Variable& bias) const;
  Variable conv(const Variable& x, const Variable& w, const Variable& bias) const;            // k3 s2 p1
  Variable conv_transpose(const Variable& z, const Variable& w, const Variable& bias) const;  // k4 s2 p1
  Variable channel_mean(const Variable& x) const;
  Variable gated_sum(const Variable& a, const Variable& x, const Variable& gate) const;
  Variable sample(const Variable& mean, const Variable& log_var, const Tensor& eps) const;
  Variable divergence(const Variable& mean, const Variable& log_var) const;
  Variable ssim(const Variable& x, const Tensor& truth) const;
};

/// Trains a small SuperTac for 60 steps; returns the losses of the first and the last.
struct Losses {
  double first, last;
};
Losses train_whole(const Ops& ops);

/// Failure 1 to 13 as a chart: what happens without the safeguard and with it. Throws std::invalid_argument.
std::string break_it(int failure);

}  // namespace lessons
