#include "autograd/ops/max_pool.h"

#include <cmath>

#include "autograd/checks.h"

namespace supertac {
namespace {

// The offset in x of the largest of the four elements of block (i, j), channel c; of a NaN if there is one.
Dim argmax(const Tensor& x, Dim n, Dim i, Dim j, Dim c) {
  const Dim width = x.dim(2), channels = x.dim(3);
  const Dim corner = ((n * x.dim(1) + 2 * i) * width + 2 * j) * channels + c;
  Dim best = corner;
  for (const Dim at : {corner + channels, corner + width * channels, corner + (width + 1) * channels}) {
    if (x.data()[at] > x.data()[best] || std::isnan(x.data()[at])) best = at;
  }
  return best;
}

template <class F>
void for_each_output(const Shape& y, F f) {
  Dim out = 0;
  for (Dim n = 0; n < y[0]; ++n) {
    for (Dim i = 0; i < y[1]; ++i) {
      for (Dim j = 0; j < y[2]; ++j) {
        for (Dim c = 0; c < y[3]; ++c) f(out++, n, i, j, c);
      }
    }
  }
}

}  // namespace

Variable max_pool2d(const Variable& x) {
  check_rank("max_pool2d", "x", x, 4);
  if (x.dim(1) < 2 || x.dim(2) < 2) refuse("max_pool2d", "x must be at least 2x2, got " + x.shape().text());
  Tensor y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2, x.dim(3)});
  for_each_output(y.shape(), [&](Dim out, Dim n, Dim i, Dim j, Dim c) {
    y.data()[out] = x.value().data()[argmax(x.value(), n, i, j, c)];
  });
  return record("max_pool2d", y, {&x}, [](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) {
      for_each_output(b.gy().shape(), [&](Dim out, Dim n, Dim i, Dim j, Dim c) {
        gx->data()[argmax(b.value(0), n, i, j, c)] += b.gy().data()[out];
      });
    }
  });
}

}  // namespace supertac
