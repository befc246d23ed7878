#include "layers/linear.h"

#include "autograd/ops/linear.h"

namespace supertac {

Linear::Linear(Dim in, Dim out, Rng& rng, Layout layout) {
  weight_ = add_parameter("weight", uniform_fan_in({in, out}, in, rng), layout);
  bias_ = add_parameter("bias", uniform_fan_in({out}, in, rng), Layout::plain);
}

Variable Linear::forward(const Variable& x, real negative_slope) const {
  return supertac::linear(x, weight_, bias_, negative_slope);
}

}  // namespace supertac
