// Convolutions, transposed convolutions and linear layers over a batch, with gradients, callable without a
// graph. Everything is channels-last: the channels of one pixel lie side by side. "= or +=" is what a Slot
// says, and nothing is computed for an empty one. Nothing is checked, and no result may overlap an input; the
// ops refuse what is wrong.
#pragma once

#include <compare>
#include <limits>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// Sizes in pixels, height and width those of x. A 1-D convolution has height 1, kernel_h 1, padding_h 0,
/// stride_h 1.
struct ConvSettings {
  Dim height = 1, width = 1;
  Dim kernel_h = 1, kernel_w = 1;
  Dim stride_h = 1, stride_w = 1;
  Dim padding_h = 0, padding_w = 0;
  bool transposed = false;
  // NOLINTNEXTLINE(modernize-use-nullptr): Clang 14 sees a 0 there
  auto operator<=>(const ConvSettings&) const = default;

  /// conv: (size + 2 padding - kernel) / stride + 1;  transposed: (size - 1) stride - 2 padding + kernel
  Dim out_height() const;
  Dim out_width() const;
  Dim taps() const { return kernel_h * kernel_w; }
};

struct ConvSizes {
  ConvSettings conv;
  Dim images = 0, cin = 0, cout = 0;
  Dim in_pixels() const { return conv.height * conv.width; }
  Dim out_pixels() const { return conv.out_height() * conv.out_width(); }
};

/// Calls meet(tap, p, q) for each pixel p of x and q of y (numbered through the batch) that a tap joins.
/// A convolution strides over x: q = (row, column) meets p = (row stride + ky - padding, ...). A transposed
/// one strides over y: the same pairs with p and q exchanged, and that is all the difference there is.
template <class Meet>
void for_each_meeting(const ConvSizes& s, Meet meet) {
  const ConvSettings& m = s.conv;
  const Dim fine_h = m.transposed ? m.out_height() : m.height;
  const Dim fine_w = m.transposed ? m.out_width() : m.width;
  const Dim coarse_h = m.transposed ? m.height : m.out_height();
  const Dim coarse_w = m.transposed ? m.width : m.out_width();
  for (Dim ky = 0; ky < m.kernel_h; ++ky) {
    for (Dim kx = 0; kx < m.kernel_w; ++kx) {
      for (Dim n = 0; n < s.images; ++n) {
        for (Dim row = 0; row < coarse_h; ++row) {
          for (Dim column = 0; column < coarse_w; ++column) {
            const Dim y = row * m.stride_h + ky - m.padding_h, x = column * m.stride_w + kx - m.padding_w;
            if (y < 0 || y >= fine_h || x < 0 || x >= fine_w) continue;  // in the padding
            const Dim coarse = (n * coarse_h + row) * coarse_w + column, fine = (n * fine_h + y) * fine_w + x;
            m.transposed ? meet(ky * m.kernel_w + kx, coarse, fine)
                         : meet(ky * m.kernel_w + kx, fine, coarse);
          }
        }
      }
    }
  }
}

/// The largest number of channels, of x or y.
inline constexpr Dim kMaxChannels = 4096;
/// A sum over rows is taken in pieces of this many, which are added in order.
inline constexpr Dim kRowsPerPiece = 256;

/// f(x) = x for x > 0, else slope * x: the activation behind a convolution or a linear layer. With a slope of
/// 0 minus infinity counts as the lowest finite number, since 0 times infinity is NaN. Backward, of y = f(s):
/// gs = gy f'(s) = y > 0 ? gy : slope * gy, since y has the sign of s.
struct Rectifier {
  real slope, floor;
  explicit Rectifier(real negative_slope)
      : slope(negative_slope),
        floor(negative_slope == 0 ? std::numeric_limits<real>::lowest()
                                  : -std::numeric_limits<real>::infinity()) {}
  real operator()(real x) const { return x > 0 ? x : slope * (floor > x ? floor : x); }
};

/// y [images, out_pixels, cout] = f(bias + sum over taps of x [images, in_pixels, cin] * w [taps, cin,
/// cout]); bias may be null; f is Rectifier(negative_slope).
void conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias, real negative_slope,
          real* y);
/// gx [images, in_pixels, cin] = or += the transpose of conv (without f) applied to gy [images, out_pixels,
/// cout].
void conv_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Slot gx);
/// gw [tap, i, o] = or += the sum of x[p, i] gy[q, o] over all images and the pixels p, q that the tap joins.
void conv_grad_w(const ConvSizes& sizes, const real* x, const real* gy, Slot gw);
/// A linear layer is a convolution of maps of one pixel: y [rows, cout] = f(bias + x [rows, cin] w [cin,
/// cout]), gx = or += gy w^T, gw = or += x^T gy.
inline void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias,
                   real negative_slope, real* y) {
  conv({{}, rows, cin, cout}, x, w, bias, negative_slope, y);
}
inline void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Slot gx) {
  conv_grad_x({{}, rows, cin, cout}, gy, w, gx);
}
inline void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Slot gw) {
  conv_grad_w({{}, rows, cin, cout}, x, gy, gw);
}
/// gb [cout] = or += the sum of gy [rows, cout] over rows: the pixels of all images.
void bias_grad(Dim rows, Dim cout, const real* gy, Slot gb);

}  // namespace supertac::kernels
