#pragma once

#include "autograd/ops/activations.h"
#include "layers/module.h"

namespace supertac {

/// y = f(x w + b), f as autograd/ops/activations.h says: x [N,in] -> [N,out]. With Layout::pointwise it is
/// stored as the 1x1 convolution that it also is.
class Linear : public Module {
 public:
  Linear(Dim in, Dim out, Rng& rng, Layout layout = Layout::linear);
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const;

 private:
  Variable weight_, bias_;
};

}  // namespace supertac
