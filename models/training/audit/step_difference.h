// Where two openings of the same step part (opened_step.h).
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "autograd/tensor.h"

namespace supertac {

/// The first entry whose bits differ; empty where none do, or the sizes differ.
std::optional<Dim> first_different_entry(const Tensor& one, const Tensor& other);

/// The first operator in which two openings of the same step differ.
struct OperatorDifference {
  std::string name, op;
  /// "output 0", "input 1" where an input differs that no operator made, "the settings".
  std::string what;
  std::string one, other;  ///< SHA-256 and shape of the arrays, or the settings
};
/// Empty when all is the same. Throws std::invalid_argument when they have other operators: of another
/// network.
std::optional<OperatorDifference> first_difference(const nlohmann::ordered_json& one,
                                                   const nlohmann::ordered_json& other);

}  // namespace supertac
