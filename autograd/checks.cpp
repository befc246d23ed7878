#include "autograd/checks.h"

#include <stdexcept>

namespace supertac {

void refuse(const char* op, const std::string& message) {
  throw std::invalid_argument(std::string(op) + ": " + message);
}

void check_defined(const char* op, const char* argument, const Variable& x) {
  if (!x.defined()) refuse(op, std::string(argument) + " expects a value, got an empty Variable");
}

void check_rank(const char* op, const char* argument, const Variable& x, int rank) {
  check_defined(op, argument, x);
  if (x.rank() == rank) return;
  refuse(op, std::string(argument) + " expects rank " + std::to_string(rank) + ", got " + x.shape().text());
}

void check_shape(const char* op, const char* argument, const Variable& x, const Shape& expected) {
  check_defined(op, argument, x);
  if (x.shape() == expected) return;
  refuse(op, std::string(argument) + " expects " + expected.text() + ", got " + x.shape().text());
}

void check_same_shape(const char* op, const char* a_name, const Variable& a, const char* b_name,
                      const Variable& b) {
  check_defined(op, a_name, a);
  check_defined(op, b_name, b);
  if (a.shape() == b.shape()) return;
  refuse(op, std::string(a_name) + " and " + b_name + " must have the same shape, got " + a.shape().text() +
                 " and " + b.shape().text());
}

}  // namespace supertac
