// Arithmetic written down as text, on numbers: the smallest graph that can be shown.
#pragma once

#include <string_view>
#include <vector>

#include "autograd/variable.h"
#include "layers/module.h"

namespace supertac {

struct Expression {
  Variable result;                ///< a scalar
  std::vector<Parameter> leaves;  ///< its numbers, under their names or as they are written
};

/// "a = 2; b = -3; relu(a * b + 10)": names for numbers or expressions, then one expression of + - * ( ),
/// relu and sigmoid. A name consists of letters; a minus in front stands before a number only. Throws
/// std::invalid_argument that says where it is none.
Expression parse_expression(std::string_view text);

}  // namespace supertac
