// What supertac-check gradients and the tests ask: every op, every layer and the whole losses, over awkward
// sizes.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "autograd/gradient_checker.h"

namespace supertac {

struct GradientCase {
  std::string kind;  ///< "op", "layer" or "loss"
  std::string name;  ///< of an op the name that it records: "conv2d"
  std::function<Variable()> f;
  std::vector<Variable> leaves;
  GradientCheckOptions options{};
  std::function<Variable(const std::vector<Variable>&)> of{};  ///< of an op: f of any leaves
};

/// Cases of one name follow each other.
std::vector<GradientCase> op_cases();
std::vector<GradientCase> layer_cases();
std::vector<GradientCase> loss_cases();

/// The cases of one name together.
struct CheckedGradients {
  std::string kind, name;
  Dim entries = 0;
  GradientEntry worst{};
  bool wrong() const { return !(worst.relative_error <= kGradientTolerance); }
};
CheckedGradients check(std::span<const GradientCase> cases_of_one_name);
/// Splits cases into runs of one name.
std::vector<std::span<const GradientCase>> by_name(std::span<const GradientCase> cases);

}  // namespace supertac
