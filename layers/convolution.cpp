#include "layers/convolution.h"

namespace supertac {

ConvLayer::ConvLayer(int dimensions, Dim in, Dim out, const ConvLayerOptions& o, Layout layout, Rng& rng)
    : options_(o) {
  const Shape shape = dimensions == 1 ? Shape{o.kernel, in, out} : Shape{o.kernel, o.kernel, in, out};
  const Dim taps = dimensions == 1 ? o.kernel : o.kernel * o.kernel;
  // PyTorch takes out * kernel as the fan-in of a transposed convolution; so do we.
  const Dim fan_in = (layout == Layout::conv_transpose ? out : in) * taps;
  weight_ = add_parameter("weight", uniform_fan_in(shape, fan_in, rng), layout);
  bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
}

Conv1d::Conv1d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng)
    : ConvLayer(1, in, out, o, Layout::conv, rng) {}
Variable Conv1d::forward(const Variable& x, real negative_slope) const {
  return conv1d(x, weight_, bias_, options(negative_slope));
}

Conv2d::Conv2d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng)
    : ConvLayer(2, in, out, o, Layout::conv, rng) {}
Variable Conv2d::forward(const Variable& x, real negative_slope) const {
  return conv2d(x, weight_, bias_, options(negative_slope));
}

ConvTranspose1d::ConvTranspose1d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng)
    : ConvLayer(1, in, out, o, Layout::conv_transpose, rng) {}
Variable ConvTranspose1d::forward(const Variable& x, real negative_slope) const {
  return conv_transpose1d(x, weight_, bias_, options(negative_slope));
}

ConvTranspose2d::ConvTranspose2d(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng)
    : ConvLayer(2, in, out, o, Layout::conv_transpose, rng) {}
Variable ConvTranspose2d::forward(const Variable& x, real negative_slope) const {
  return conv_transpose2d(x, weight_, bias_, options(negative_slope));
}

}  // namespace supertac
