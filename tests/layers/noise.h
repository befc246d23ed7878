// Random maps for the tests of layers.
#pragma once

#include "autograd/tensor.h"
#include "io/numbers/random.h"

namespace supertac {

/// Normal numbers, a pure function of the seed.
inline Tensor noise(const Shape& shape, std::uint64_t seed) {
  Tensor t(shape);
  const RandomStream random(seed, 7);
  std::uint64_t i = 0;
  for (real& x : t.values()) x = static_cast<real>(random.normal(i++));
  return t;
}

inline double variance(const Tensor& t) {
  double sum = 0, squares = 0;
  for (const real x : t.values()) {
    sum += static_cast<double>(x);
    squares += static_cast<double>(x) * static_cast<double>(x);
  }
  const double n = static_cast<double>(t.size()), mean = sum / n;
  return squares / n - mean * mean;
}

}  // namespace supertac
