// Adam (Kingma & Ba 2015, algorithm 1) with bias correction and clipping of the gradient norm.
#pragma once

#include <cstdint>
#include <vector>

#include "autograd/variable.h"

namespace supertac {

struct AdamOptions {
  double learning_rate = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;
  /// The gradient is scaled down to this L2 norm over all parameters when it is longer; 0 = never.
  double clip_norm = 0;
};

class Adam {
 public:
  /// Throws std::invalid_argument for rates outside their ranges or parameters without gradients.
  Adam(std::vector<Variable> parameters, const AdamOptions& options);

  /// Sets every gradient to zero; call it before backward().
  void zero_grad();
  /// m = b1 m + (1-b1) g;  v = b2 v + (1-b2) g^2;  x -= lr (m / (1-b1^t)) / (sqrt(v / (1-b2^t)) + epsilon).
  /// Returns the gradient's norm before clipping, infinity when the square of the clipped one overflows
  /// `real`. When it is not finite nothing is changed: check it.
  double step();
  void set_learning_rate(double rate) { options_.learning_rate = rate; }

  std::int64_t steps() const { return steps_; }
  /// For exact resume: the moments in parameter order, and the step count that belongs to them.
  std::vector<Tensor>& first_moments() { return m_; }
  std::vector<Tensor>& second_moments() { return v_; }
  void set_steps(std::int64_t steps) { steps_ = steps; }

 private:
  std::vector<Variable> parameters_;
  AdamOptions options_;
  std::vector<Tensor> m_, v_;
  std::int64_t steps_ = 0;
};

}  // namespace supertac
