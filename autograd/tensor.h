// Tensor: a contiguous, row-major array of at most four dimensions.
//
// A Tensor is a cheap handle to one buffer: copying it copies the handle, clone() the contents.
// There are no strides and no views. Activations are channels-last, [N,L,C] or [N,H,W,C]: the
// channels of one pixel lie side by side, which is what the convolution kernels read and write.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>

namespace supertac {

#ifdef SUPERTAC_REAL_IS_DOUBLE
using real = double;  // the gradient checks compile the same sources in double precision
#else
using real = float;
#endif

using Dim = std::int64_t;
/// What a kernel does with the buffer that it is given for its result.
enum class Into { overwrite, add };
/// Where a kernel leaves a gradient: = or +=, as `into` says, or nowhere where `data` is null. One variable
/// may be several inputs of an op, so kernels write gradients in the order of the inputs.
struct Slot {
  real* data = nullptr;
  Into into = Into::add;
  explicit operator bool() const { return data != nullptr; }
  /// For kernels that add only: zeros in `count` places that are to be overwritten.
  void begin(Dim count) const {
    if (data != nullptr && into == Into::overwrite) std::fill_n(data, count, real(0));
  }
};
inline constexpr int kMaxRank = 4;

/// The sizes of a tensor's dimensions, outermost first. Rank 0 is a scalar with one element.
class Shape {
 public:
  Shape() = default;
  /// Throws std::invalid_argument for more than four dimensions, a negative one, or a product over 2^40.
  Shape(std::initializer_list<Dim> dims);
  explicit Shape(std::span<const Dim> dims);

  int rank() const { return rank_; }
  /// 0 <= i < rank(), which is not checked.
  Dim operator[](int i) const { return dims_[static_cast<std::size_t>(i)]; }
  Dim elements() const;
  std::span<const Dim> dims() const { return {dims_.data(), static_cast<std::size_t>(rank_)}; }
  /// "[4,16,16,32]"
  std::string text() const;
  bool operator==(const Shape& other) const { return rank_ == other.rank_ && dims_ == other.dims_; }

 private:
  std::array<Dim, kMaxRank> dims_{};
  int rank_ = 0;
};

class Tensor {
 public:
  Tensor() = default;                   ///< no buffer; defined() is false
  explicit Tensor(const Shape& shape);  ///< contents undefined
  static Tensor full(const Shape& shape, real value);
  static Tensor zeros(const Shape& shape) { return full(shape, 0); }
  /// Throws std::invalid_argument unless the number of values fits the shape.
  static Tensor of(const Shape& shape, std::span<const real> values);
  static Tensor of(const Shape& shape, std::initializer_list<real> values) {
    return of(shape, std::span<const real>(values.begin(), values.size()));
  }

  bool defined() const { return values_ != nullptr; }
  const Shape& shape() const { return shape_; }
  int rank() const { return shape_.rank(); }
  Dim dim(int i) const { return shape_[i]; }
  Dim size() const { return defined() ? shape_.elements() : 0; }
  /// Of its shape, "[4,16,16,32]"; "none" where it has no buffer.
  std::string text() const { return defined() ? shape_.text() : "none"; }

  real* data() { return values_.get(); }
  const real* data() const { return values_.get(); }
  std::span<real> values() { return {data(), static_cast<std::size_t>(size())}; }
  std::span<const real> values() const { return {data(), static_cast<std::size_t>(size())}; }

  /// The only deep copy.
  Tensor clone() const;
  void fill(real value);
  /// The only element. Throws std::invalid_argument for any other size.
  real item() const;

 private:
  std::shared_ptr<real> values_;  // from the pool, aligned for vectors
  Shape shape_;
};

}  // namespace supertac
