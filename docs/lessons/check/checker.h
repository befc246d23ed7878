// What the lessons are checked with: the project's gradient checker, and sentences about what it finds.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "autograd/gradient_checker.h"
#include "autograd/record.h"

namespace lessons {

/// One array of a lesson beside what it should be.
struct Compared {
  std::string name;        ///< "gw"
  std::vector<int> shape;  ///< row-major
  std::vector<double> yours, right;
};

/// "gw [1,0]: yours 2, differences give 4 (22 of 22 entries are wrong, by the factor 0.5)": the worst entry,
/// and the factor where all have one. Empty when all agree to 1e-6 of the largest.
std::string finding(const Compared& array, const std::string& from);

/// Prints a line for each array. Counts what is wrong.
class Report {
 public:
  void add(const std::string& what, const Compared& array, const std::string& from = "it should be");
  void add(const std::string& what, double yours, double right) { add(what, {what, {1}, {yours}, {right}}); }
  /// Gradients by the project's checker. `names` and `shapes` are the inputs'.
  void gradients(const std::string& what, const std::vector<std::string>& names,
                 const std::vector<supertac::Tensor>& inputs,
                 const std::function<supertac::Variable(const std::vector<supertac::Variable>&)>& f);
  /// The same of gradients that are known.
  void gradients(const std::string& what, const std::vector<Compared>& arrays);
  int wrong() const { return wrong_; }

 private:
  int wrong_ = 0;
};

/// Irregular numbers between low and high, none of them near 0.
supertac::Tensor numbers(const supertac::Shape& shape, double low = -1, double high = 1);

/// Names the lesson and ends with 1 where the program would abort: -D_GLIBCXX_ASSERTIONS sees indices
/// outside.
void name_aborts(const char* lesson);

}  // namespace lessons
