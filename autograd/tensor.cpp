#include "autograd/tensor.h"

#include <algorithm>
#include <new>
#include <utility>

#include "autograd/kernels/fast/pool.h"
#include "autograd/record.h"

namespace supertac {

namespace {
constexpr Dim kMaxElements = Dim{1} << 40;
constexpr std::size_t kHeader = 64;  // the buffer's header; the values start on the next cache line
}  // namespace

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

Tensor::Tensor(const Shape& shape) : size_(shape.elements()), shape_(shape) {
  const std::size_t bytes = kHeader + static_cast<std::size_t>(size_) * sizeof(real);
  void* block = pool_allocate(bytes);
  buffer_ = new (block) Buffer{{1}, bytes};
  values_ = reinterpret_cast<real*>(static_cast<std::byte*>(block) + kHeader);
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

Tensor::Tensor(const Tensor& other) noexcept
    : buffer_(other.buffer_), values_(other.values_), size_(other.size_), shape_(other.shape_) {
  if (buffer_ != nullptr) buffer_->users.fetch_add(1, std::memory_order_relaxed);
}

Tensor::Tensor(Tensor&& other) noexcept { swap(other); }

Tensor& Tensor::operator=(Tensor other) noexcept {
  swap(other);
  return *this;
}

void Tensor::swap(Tensor& other) noexcept {
  std::swap(buffer_, other.buffer_);
  std::swap(values_, other.values_);
  std::swap(size_, other.size_);
  std::swap(shape_, other.shape_);
}

Tensor::~Tensor() {
  if (buffer_ != nullptr && buffer_->users.fetch_sub(1, std::memory_order_acq_rel) == 1)
    pool_release(buffer_, buffer_->bytes);
}

Tensor Tensor::clone() const {
  if (!defined()) return {};
  Tensor t(shape_);
  std::copy_n(values_, size_, t.values_);
  return t;
}

void Tensor::fill(real value) { std::fill_n(values_, size_, value); }

real Tensor::item() const {
  if (size_ != 1) refuse("item", "the tensor", "one element", shape_.text());
  return values_[0];
}

}  // namespace supertac
