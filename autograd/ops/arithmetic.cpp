#include "autograd/ops/arithmetic.h"

#include "autograd/ops/elementwise.h"

namespace supertac {

// a, b, y of one shape, here and below;  y = a + b;  ga = gb = gy
Variable operator+(const Variable& a, const Variable& b) {
  check_same_shape("add", "a", a, "b", b);
  Tensor y(a.shape());
  each(y.size(), [a = a.value().data(), b = b.value().data(), to = y.data()](Dim i) { to[i] = a[i] + b[i]; });
  return record("add", y, {&a, &b}, [](Backward& g) {
    for (const std::size_t input : {0, 1})
      add_to_gradient(g, input, [gy = g.gy().data()](Dim i) { return gy[i]; });
  });
}

// y = a b;  ga = gy b,  gb = gy a
Variable operator*(const Variable& a, const Variable& b) {
  check_same_shape("multiply", "a", a, "b", b);
  Tensor y(a.shape());
  each(y.size(), [a = a.value().data(), b = b.value().data(), to = y.data()](Dim i) { to[i] = a[i] * b[i]; });
  return record("multiply", y, {&a, &b}, [](Backward& g) {
    for (const std::size_t input : {0, 1}) {
      add_to_gradient(g, input, [gy = g.gy().data(), other = g.value(1 - input).data()](Dim i) {
        return gy[i] * other[i];
      });
    }
  });
}

// y[i] = factor x[i];  gx = factor gy
Variable operator*(real factor, const Variable& x) {
  return elementwise(
      "scale", x, [factor](real at) { return factor * at; },
      [factor](real gy, real, real) { return factor * gy; }, {.factor = factor});
}

// a, b of one shape, y = a - b;  ga = gy, gb = -gy, by the ops above
Variable operator-(const Variable& a, const Variable& b) {
  check_same_shape("subtract", "a", a, "b", b);
  return a + -1 * b;
}
Variable operator-(real number, const Variable& x) {
  check_defined("subtract", "x", x);
  return Variable(Tensor::full(x.shape(), number)) + -1 * x;
}

// x of any shape, y [] = the sum of its elements;  gx[i] = gy
Variable sum(const Variable& x) {
  check_defined("sum", "x", x);
  const double total = kernels::sum_of(x.size(), [from = x.value().data()](Dim i) { return from[i]; });
  return record("sum", Tensor::full({}, static_cast<real>(total)), {&x},
                [](Backward& g) { add_to_gradient(g, 0, [gy = g.gy().item()](Dim) { return gy; }); });
}

}  // namespace supertac
