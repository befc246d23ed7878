// Compares the gradients of backward() with finite differences, entry by entry. Meant for the double build.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "autograd/variable.h"

namespace supertac {

/// The largest relative error of an entry that is right.
inline constexpr double kGradientTolerance = 1e-6;

struct GradientEntry {
  std::size_t input;  // which of the inputs
  Dim index;          // which of its elements, in row-major order
  double analytic, numeric;
  /// |analytic - numeric| / (max(|analytic|, |numeric|) + 1e-3 * the largest gradient of that input
  ///                         + 1e-5 * the largest gradient of all inputs), the denominator at least 1e-10;
  /// 1e30 when it is not finite
  double relative_error;
  /// "encoder.2.conv.1.weight [3,0,7] of [4,2,9]": the input's name, the element's indices in memory, the
  /// shape
  std::string place;
};

/// Of empty inputs nothing is compared: entries and max_relative_error are 0, and text() says so.
struct GradientReport {
  std::vector<GradientEntry> worst;  // the largest errors first, at most ten
  double max_relative_error = 0;
  Dim entries = 0;   // that were compared
  Dim elements = 0;  // of all inputs, from which they are taken evenly
  Dim wrong = 0;     // entries beyond kGradientTolerance
  /// Analytic through numeric where it is the same for all wrong entries (but of 0 by 0), to a thousandth: -1
  /// is a sign, 2 a factor, 0 that no gradient arrives; NaN where they differ, as where a term is missing.
  double ratio = std::numeric_limits<double>::quiet_NaN();
  /// How many are wrong, and one line per entry of `worst`, for a failing test to print:
  /// "1 of 72 entries (of 4608 elements) off by more than 1e-06, analytic = -1 numeric in each"
  /// "encoder.2.conv.1.weight [3,0,7] of [4,2,9]: analytic 0.25, numeric 0.5, relative error 0.5"
  /// An entry of `worst` that is right ends in " (right)".
  std::string text() const;
};

struct GradientCheckOptions {
  /// Of the five-point stencil, relative to max(1, |x|). Where the gradients disagree two shorter steps are
  /// tried and the nearest difference counts: a rectifier's kink between the points spoils that step alone.
  double step = 1e-3;
  Dim max_entries_per_input = 200;      // larger inputs are sampled evenly
  std::vector<std::string> names = {};  // of the inputs; "input 0", "input 1" ... where there is none
};

/// `f` computes a result of any shape from the leaves, deterministically, whenever it is called. The result
/// is reduced to the scalar sum(y * r) with fixed weights r that differ from element to element, so that no
/// gradient hides in a symmetry. The leaves (parameters, for example) are shifted and put back; their
/// gradients are overwritten, by twice the gradient: backward() runs twice, since the first is written and
/// the second added. What f throws comes through, with the leaves put back.
GradientReport check_gradients(const std::function<Variable()>& f, std::vector<Variable> leaves,
                               const GradientCheckOptions& options = {});

}  // namespace supertac
