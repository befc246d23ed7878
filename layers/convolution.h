// Convolution layers, channels-last, each with the activation behind it: see autograd/ops/convolution.h for
// the formulas and what is thrown.
#pragma once

#include "autograd/ops/convolution.h"
#include "layers/module.h"

namespace supertac {

struct ConvLayerOptions {
  Dim kernel = 3;
  Dim stride = 1;
  Dim padding = 0;
};
/// The output is as large as the input.
inline constexpr ConvLayerOptions kSameSize{.kernel = 3, .stride = 1, .padding = 1};

/// A weight [kernel..., in, out] and a bias [out], drawn by uniform_fan_in() with a fan-in of taps * in
/// (transposed: taps * out, as in PyTorch); the constructor throws as that does.
template <int kDimensions, bool kTransposed>
class ConvLayer : public Module {
 public:
  ConvLayer(Dim in, Dim out, const ConvLayerOptions& o, Rng& rng) : options_(o) {
    const Shape shape = kDimensions == 1 ? Shape{o.kernel, in, out} : Shape{o.kernel, o.kernel, in, out};
    const Dim taps = kDimensions == 1 ? o.kernel : o.kernel * o.kernel;
    const Dim fan_in = (kTransposed ? out : in) * taps;
    weight_ = add_parameter("weight", uniform_fan_in(shape, fan_in, rng),
                            kTransposed ? Layout::conv_transpose : Layout::conv);
    bias_ = add_parameter("bias", uniform_fan_in({out}, fan_in, rng), Layout::plain);
  }
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const {
    constexpr auto op = kTransposed ? (kDimensions == 1 ? conv_transpose1d : conv_transpose2d)
                                    : (kDimensions == 1 ? conv1d : conv2d);
    return op(x, weight_, bias_, {options_.stride, options_.padding, negative_slope});
  }

 private:
  ConvLayerOptions options_;
  Variable weight_, bias_;
};

using Conv1d = ConvLayer<1, false>;  ///< x [N,L,in] -> [N, (L + 2 padding - kernel) / stride + 1, out]
using Conv2d = ConvLayer<2, false>;  ///< x [N,H,W,in] -> [N,H',W',out], each side as Conv1d's
using ConvTranspose1d = ConvLayer<1, true>;  ///< x [N,L,in] -> [N, (L - 1) stride - 2 padding + kernel, out]
using ConvTranspose2d = ConvLayer<2, true>;  ///< x [N,H,W,in] -> [N,H',W',out], likewise

}  // namespace supertac
