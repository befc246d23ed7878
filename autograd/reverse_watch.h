// ReverseWatch: stands between backward() and the reverse steps, to measure them or to plant an error that a
// check has to notice (apps/check/gradients_main.cpp).
#pragma once

#include <cstddef>
#include <functional>

#include "autograd/record.h"

namespace supertac {

/// While one lives, backward() of this thread hands every reverse step to it. One at a time.
class ReverseWatch {
 public:
  /// Throws std::logic_error where this thread has one already.
  ReverseWatch();
  virtual ~ReverseWatch();
  ReverseWatch(const ReverseWatch&) = delete;
  ReverseWatch& operator=(const ReverseWatch&) = delete;

  /// Must call `step`, which reads b.gy() and adds into the gradients of the op's inputs; it may be called
  /// again once those gradients and b.gy() have been restored.
  virtual void reverse(const char* op, std::size_t inputs, Backward& b,
                       const std::function<void()>& step) = 0;
};

}  // namespace supertac
