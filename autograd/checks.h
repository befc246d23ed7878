// The one wording for rejected arguments: op, argument, expected, got.
#pragma once

#include <string>

#include "autograd/record.h"

namespace supertac {

/// Each throws std::invalid_argument, e.g. "conv2d: x expects rank 4, got [2,3]"; the others check_defined(),
/// too.
void check_defined(const char* op, const char* argument, const Variable& x);
void check_rank(const char* op, const char* argument, const Variable& x, int rank);
void check_shape(const char* op, const char* argument, const Variable& x, const Shape& expected);
void check_same_shape(const char* op, const char* a_name, const Variable& a, const char* b_name,
                      const Variable& b);
/// "op: message"
[[noreturn]] void refuse(const char* op, const std::string& message);

}  // namespace supertac
