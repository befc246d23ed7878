#include "layers/convolution.h"

#include "autograd/ops/convolution.h"

namespace supertac {

// PyTorch takes out * kernel as the fan-in of a transposed convolution; so do we.

Conv1d::Conv1d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng) : options_(o) {
  weight_ = add_parameter("weight", uniform_fan_in({o.kernel, in, out}, in * o.kernel, rng), Layout::conv);
  bias_ = add_parameter("bias", uniform_fan_in({out}, in * o.kernel, rng), Layout::plain);
}
Variable Conv1d::forward(const Variable& x) const {
  return conv1d(x, weight_, bias_, {.stride = options_.stride, .padding = options_.padding});
}

Conv2d::Conv2d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng) : options_(o) {
  const Dim fan_in = in * o.kernel * o.kernel;
  weight_ = add_parameter("weight", uniform_fan_in({o.kernel, o.kernel, in, out}, fan_in, rng), Layout::conv);
  bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
}
Variable Conv2d::forward(const Variable& x) const {
  return conv2d(x, weight_, bias_, {.stride = options_.stride, .padding = options_.padding});
}

ConvTranspose1d::ConvTranspose1d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng) : options_(o) {
  const Dim fan_in = out * o.kernel;
  weight_ = add_parameter("weight", uniform_fan_in({o.kernel, in, out}, fan_in, rng), Layout::conv_transpose);
  bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
}
Variable ConvTranspose1d::forward(const Variable& x) const {
  return conv_transpose1d(x, weight_, bias_, {.stride = options_.stride, .padding = options_.padding});
}

ConvTranspose2d::ConvTranspose2d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng) : options_(o) {
  const Dim fan_in = out * o.kernel * o.kernel;
  weight_ = add_parameter("weight", uniform_fan_in({o.kernel, o.kernel, in, out}, fan_in, rng),
                          Layout::conv_transpose);
  bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
}
Variable ConvTranspose2d::forward(const Variable& x) const {
  return conv_transpose2d(x, weight_, bias_, {.stride = options_.stride, .padding = options_.padding});
}

}  // namespace supertac
