// A linear layer with its weights.
#pragma once

#include "autograd/ops/linear.h"
#include "layers/module.h"

namespace supertac {

/// y = f(x w + b), f as autograd/ops/activations.h says: x [N,in] -> [N,out]. Weights as uniform_fan_in().
/// With Layout::pointwise it is stored as the 1x1 convolution that it also is.
class Linear : public Module {
 public:
  Linear(Dim in, Dim out, Rng& rng, Layout layout = Layout::linear)
      : weight_(add_parameter("weight", uniform_fan_in({in, out}, in, rng), layout)),
        bias_(add_parameter("bias", uniform_fan_in({out}, in, rng), Layout::plain)) {}
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const {
    return linear(x, weight_, bias_, negative_slope);
  }

 private:
  Variable weight_, bias_;
};

}  // namespace supertac
