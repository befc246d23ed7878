#include "autograd/ops/max_pool.h"

#include <cmath>

#include "autograd/checks.h"

namespace supertac {
namespace {

// Calls visit(from, to) for each element of y with the place of the largest of its four elements of x: of
// the first among equal ones, of a NaN if there is one.
template <class Visit>
void for_each_maximum(const Tensor& x, Visit visit) {
  const Dim height = x.dim(1), width = x.dim(2), channels = x.dim(3);
  const real* value = x.data();
  Dim to = 0;
  for (Dim n = 0; n < x.dim(0); ++n) {
    for (Dim i = 0; i < height / 2; ++i) {
      for (Dim j = 0; j < width / 2; ++j) {
        for (Dim c = 0; c < channels; ++c) {
          const Dim corner = ((n * height + 2 * i) * width + 2 * j) * channels + c,
                    below = corner + width * channels;
          Dim best = corner;
          for (const Dim at : {corner + channels, below, below + channels}) {
            if (value[at] > value[best] || std::isnan(value[at])) best = at;
          }
          visit(best, to++);
        }
      }
    }
  }
}

}  // namespace

// x [N,H,W,C], y [N,H/2,W/2,C];  gx[where the largest was] += gy
Variable max_pool2d(const Variable& x) {
  check_rank("max_pool2d", "x", x, 4);
  if (x.dim(1) < 2 || x.dim(2) < 2) refuse("max_pool2d", "x must be at least 2x2, got " + x.shape().text());
  Tensor y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2, x.dim(3)});
  for_each_maximum(x.value(), [&](Dim from, Dim to) { y.data()[to] = x.value().data()[from]; });
  return record("max_pool2d", y, {&x}, [](Backward& g) {
    Tensor* gx = g.grad_of(0);
    if (gx == nullptr) return;
    for_each_maximum(g.value(0), [&](Dim from, Dim to) { gx->data()[from] += g.gy().data()[to]; });
  });
}

}  // namespace supertac
