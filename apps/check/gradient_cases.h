// What supertac-check gradients and the tests ask: every op, every layer and the whole losses, over awkward
// sizes.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "autograd/gradient_checker.h"

namespace supertac {

struct GradientCase {
  std::string kind;  ///< "op", "layer" or "loss"
  std::string name;  ///< of an op the name that it records: "conv2d"
  /// Called with these leaves; an op's also with others of the same kind.
  std::function<Variable(const std::vector<Variable>&)> f;
  std::vector<Variable> leaves;
  GradientCheckOptions options{};
  std::vector<bool> is_weight{};  ///< of an op, for each leaf: its size does not follow the number of rows

  GradientReport check() const {
    return check_gradients([this] { return f(leaves); }, leaves, options);
  }
};

/// All of them, and those of ops alone. Cases of one name follow each other.
std::vector<GradientCase> gradient_cases();
std::vector<GradientCase> op_cases();

}  // namespace supertac
