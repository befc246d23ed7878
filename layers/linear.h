#pragma once

#include "layers/module.h"

namespace supertac {

/// y = x w + b: x [N,in] -> [N,out]. With Layout::pointwise it is stored as the 1x1 convolution that it also
/// is.
class Linear : public Module {
 public:
  Linear(Dim in, Dim out, Rng& rng, Layout layout = Layout::linear);
  Variable forward(const Variable& x) const;

 private:
  Variable weight_, bias_;
};

}  // namespace supertac
