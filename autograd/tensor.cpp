#include "autograd/tensor.h"

#include <algorithm>

#include "autograd/kernels/fast/pool.h"
#include "autograd/record.h"

namespace supertac {

static constexpr Dim kMaxElements = Dim{1} << 40;

Shape::Shape(std::initializer_list<Dim> dims) : Shape(std::span<const Dim>(dims.begin(), dims.size())) {}

Shape::Shape(std::span<const Dim> dims) {
  if (dims.size() > kMaxRank) refuse("Shape", "dims", "at most 4", std::to_string(dims.size()));
  Dim elements = 1;
  for (const Dim dim : dims) {
    if (dim < 0 || (dim > 0 && elements > kMaxElements / dim))
      refuse("Shape", "dimension " + std::to_string(rank_), "0 or more, and a product of 2^40 or less",
             std::to_string(dim));
    elements *= dim;
    dims_[static_cast<std::size_t>(rank_++)] = dim;
  }
}

Dim Shape::elements() const {
  Dim n = 1;
  for (int i = 0; i < rank_; ++i) n *= (*this)[i];
  return n;
}

std::string Shape::text() const {
  std::string out = "[";
  for (int i = 0; i < rank_; ++i) out += (i ? "," : "") + std::to_string((*this)[i]);
  return out + "]";
}

Tensor::Tensor(const Shape& shape) : shape_(shape) {
  const std::size_t bytes = static_cast<std::size_t>(shape.elements()) * sizeof(real);
  values_ = {static_cast<real*>(pool_allocate(bytes)), [bytes](real* values) { pool_release(values, bytes); },
             PoolAllocator<real>()};
}

Tensor Tensor::full(const Shape& shape, real value) {
  Tensor t(shape);
  t.fill(value);
  return t;
}

Tensor Tensor::of(const Shape& shape, std::span<const real> values) {
  Tensor t(shape);
  if (static_cast<Dim>(values.size()) != t.size())
    refuse("Tensor::of", "values", std::to_string(t.size()) + " numbers for " + shape.text(),
           std::to_string(values.size()));
  std::copy(values.begin(), values.end(), t.data());
  return t;
}

Tensor Tensor::clone() const {
  if (!defined()) return {};
  return of(shape_, values());
}

void Tensor::fill(real value) { std::ranges::fill(values(), value); }

real Tensor::item() const {
  if (size() != 1) refuse("Tensor::item", "this", "one element", text());
  return *values_;
}

}  // namespace supertac
