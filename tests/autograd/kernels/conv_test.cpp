// The plain loops of kernels/conv.cpp against those of kernels/fast on every instruction
// set: the sets have the same bytes, and those of the plain loops where both add in the same order.
#include "autograd/kernels/conv.h"

#include "autograd/kernels/fast/conv.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::kernels {
namespace {

using test::numbers;
using test::same_bytes;

struct ConvCase {
  Dim images, height, width, cin, cout, kernel, stride, padding;
};
// H != W, stride 2 and 3, no padding and much, a single pixel, channels around the vector lengths; few
// outputs (narrow); squares of 8x8 and more in batches (Winograd), of whose 513 tiles the last is alone in
// its piece.
const ConvCase kConvCases[] = {
    {2, 5, 7, 3, 17, 3, 1, 1},    {1, 6, 4, 1, 1, 3, 2, 1},    {2, 7, 5, 17, 3, 3, 2, 1},
    {1, 4, 4, 33, 1, 3, 1, 1},    {2, 3, 4, 1, 33, 1, 1, 0},   {1, 5, 4, 17, 33, 2, 2, 0},
    {3, 4, 3, 3, 5, 4, 2, 1},     {1, 9, 2, 16, 32, 3, 1, 2},  {2, 1, 1, 3, 8, 3, 1, 1},
    {70, 4, 4, 8, 9, 3, 1, 1},    {9, 8, 11, 40, 1, 3, 1, 1},  {1, 3, 3, 2, 2, 1, 3, 2},
    {5, 8, 12, 32, 16, 3, 1, 1},  {4, 16, 8, 16, 48, 3, 1, 1}, {0, 4, 4, 3, 5, 3, 1, 1},
    {3, 5, 9, 16, 5, 3, 1, 1},    {2, 4, 6, 13, 3, 3, 1, 1},  // in 1-D narrow with several outputs
    {4, 8, 8, 16, 16, 3, 1, 1},   {7, 8, 8, 32, 48, 3, 1, 1},  {5, 16, 16, 32, 16, 3, 1, 1},
    {57, 12, 12, 16, 16, 3, 1, 1}};

ConvSizes sizes_of(const ConvCase& c, bool transposed, bool flat) {
  return {{.height = flat ? 1 : c.height,
           .width = c.width,
           .kernel_h = flat ? 1 : c.kernel,
           .kernel_w = c.kernel,
           .stride_h = flat ? 1 : c.stride,
           .stride_w = c.stride,
           .padding_h = flat ? 0 : c.padding,
           .padding_w = c.padding,
           .transposed = transposed},
          c.images,
          c.cin,
          c.cout};
}

// What `run` gives on the plain loops and on every set, whose results must agree.
template <class Run>
void expect_plain_is_fast(const char* what, bool same_order, Run run) {
  const IsaKernels& chosen = isa_kernels();
  Tensor fast, plain;
  for (const IsaKernels* set : supported_sets()) {
    use_isa(*set);
    const Tensor found = run();
    if (set == &kPlainKernels) {
      plain = found;
    } else if (!fast.defined()) {
      fast = found;
    } else {
      ASSERT_TRUE(same_bytes(found, fast)) << what << " on " << set->name;
    }
  }
  use_isa(chosen);
  double largest = 0;
  for (const real value : plain.values()) largest = std::max(largest, std::abs(static_cast<double>(value)));
  const double tolerance = same_order ? 0 : (sizeof(real) == 4 ? 1e-5 : 1e-13) * largest;
  for (Dim i = 0; i < plain.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(fast.data()[i]), static_cast<double>(plain.data()[i]), tolerance)
        << what << " [" << i << "] on " << chosen.name;
  }
}

void expect_plain_is_fast(const ConvSizes& s) {
  const bool same_order = !is_narrow(s) && !is_winograd(s);
  const Dim taps = s.conv.taps(), fits = kRowsPerPiece / s.out_pixels();
  const Tensor x = numbers({s.images, s.in_pixels(), s.cin}), w = numbers({taps, s.cin, s.cout}, 2),
               bias = numbers({s.cout}, 3), gy = numbers({s.images, s.out_pixels(), s.cout}, 4);
  for (const real* b : {bias.data(), static_cast<const real*>(nullptr)}) {
    for (const real slope : {real(1), real(0.25), real(0)}) {
      expect_plain_is_fast("y", same_order, [&] {
        Tensor y(gy.shape());
        conv(s, x.data(), w.data(), b, slope, y.data());
        return y;
      });
    }
  }
  // A sum that is -0 so far stays -0 where a tap is skipped, and becomes +0 where 0 * w is added.
  expect_plain_is_fast("sign of zero", true, [&] {
    Tensor y(gy.shape());
    conv(s, Tensor::full(x.shape(), real(-0.0)).data(), Tensor::full(w.shape(), 1).data(),
         Tensor::full(bias.shape(), real(-0.0)).data(), real(0.25), y.data());
    return y;
  });
  for (const Into into : {Into::overwrite, Into::add}) {
    expect_plain_is_fast("gx", same_order, [&] {
      Tensor gx = numbers(x.shape(), 5);
      conv_grad_x(s, gy.data(), w.data(), {gx.data(), into});
      return gx;
    });
  }
  const auto grad_w = [&](Into into, Tensor gw) {
    conv_grad_w(s, x.data(), gy.data(), {gw.data(), into});
    return gw;
  };
  for (const Into into : {Into::overwrite, Into::add}) {  // fast/ sums images apart before it adds them
    expect_plain_is_fast("gw", same_order && into == Into::overwrite && s.images <= fits,
                         [&] { return grad_w(into, numbers(w.shape(), 6)); });
  }
  EXPECT_TRUE(same_bytes(grad_w(Into::overwrite, numbers(w.shape(), 6)),
                         grad_w(Into::add, Tensor::zeros(w.shape()))));
}

TEST(ConvKernels, PlainIsFast) {
  for (const ConvCase& c : kConvCases) {
    for (const bool flat : {false, true}) {
      for (const bool transposed : {false, true}) {
        const ConvSizes s = sizes_of(c, transposed, flat);
        if (s.conv.out_height() < 1 || s.conv.out_width() < 1) continue;
        SCOPED_TRACE("case " + std::to_string(&c - kConvCases) + (transposed ? " transposed" : "") +
                     (flat ? " 1-D" : " 2-D"));
        expect_plain_is_fast(s);
      }
    }
  }
}

// The cases above must keep meeting every way that fast/ knows.
TEST(ConvKernels, TheCasesTakeEveryWay) {
  int narrow = 0, winograd = 0, tiles = 0;
  for (const ConvCase& c : kConvCases) {
    const ConvSizes s = sizes_of(c, false, false);
    ++(is_narrow(s) ? narrow : is_winograd(s) ? winograd : tiles);
  }
  EXPECT_GE(narrow, 2);
  EXPECT_GE(winograd, 6);
  EXPECT_GE(tiles, 8);
}

TEST(LinearKernels, PlainIsFast) {
  for (const Dim rows : {0, 1, 7, 300}) {
    for (const Dim cin : {1, 5, 33, 130}) {  // 130 x 64 pass in pieces
      for (const Dim cout : {1, 10, 64}) {
        SCOPED_TRACE((Shape{rows, cin, cout}).text());
        expect_plain_is_fast({{}, rows, cin, cout});
        const Tensor x = numbers({rows, cin}), w = numbers({cin, cout}, 2), gy = numbers({rows, cout}, 4);
        expect_plain_is_fast("y", true, [&] {  // nothing behind it is written by vectors that are partly used
          Tensor y = Tensor::full({rows * cout + 40}, 7);
          linear(rows, cin, cout, x.data(), w.data(), nullptr, real(0.25), y.data());
          return y;
        });
        Tensor gb = numbers({cout}, 7), added = Tensor::zeros({cout});
        bias_grad(rows, cout, gy.data(), {gb.data(), Into::overwrite});
        bias_grad(rows, cout, gy.data(), {added.data(), Into::add});
        EXPECT_TRUE(same_bytes(gb, added));
      }
    }
  }
}

}  // namespace
}  // namespace supertac::kernels
