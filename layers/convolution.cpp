#include "layers/convolution.h"

namespace supertac {

template <int kDimensions, bool kTransposed>
ConvLayer<kDimensions, kTransposed>::ConvLayer(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng)
    : options_(o) {
  const Shape shape = kDimensions == 1 ? Shape{o.kernel, in, out} : Shape{o.kernel, o.kernel, in, out};
  const Dim taps = kDimensions == 1 ? o.kernel : o.kernel * o.kernel;
  // PyTorch takes out * kernel as the fan-in of a transposed convolution; so do we.
  const Dim fan_in = (kTransposed ? out : in) * taps;
  weight_ = add_parameter("weight", uniform_fan_in(shape, fan_in, rng),
                          kTransposed ? Layout::conv_transpose : Layout::conv);
  bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
}

template <int kDimensions, bool kTransposed>
Variable ConvLayer<kDimensions, kTransposed>::forward(const Variable& x, real negative_slope) const {
  constexpr auto op = kTransposed ? (kDimensions == 1 ? conv_transpose1d : conv_transpose2d)
                                  : (kDimensions == 1 ? conv1d : conv2d);
  return op(x, weight_, bias_, {options_.stride, options_.padding, negative_slope});
}

template class ConvLayer<1, false>;
template class ConvLayer<2, false>;
template class ConvLayer<1, true>;
template class ConvLayer<2, true>;

}  // namespace supertac
