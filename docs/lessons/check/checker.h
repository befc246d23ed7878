// What the lessons are checked with: differences, and sentences about what they find.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace lessons {

/// One array of a lesson beside what it should be.
struct Compared {
  std::string name;        ///< "gw"
  std::vector<int> shape;  ///< row-major
  std::vector<double> yours = {}, right = {};
};

/// "gw [1,0]: yours 2, differences give 4 (22 of 22 entries are wrong, by the factor 0.5)": the worst entry,
/// and the factor where all have one. Empty when all agree to 1e-6 of the largest.
std::string finding(const Compared& array, const std::string& from);

/// Prints a line for each array. Counts what is wrong.
class Report {
 public:
  void add(const std::string& what, const Compared& array, const std::string& from = "it should be");
  void add(const std::string& what, double yours, double right) { add(what, {what, {1}, {yours}, {right}}); }
  int wrong() const { return wrong_; }

 private:
  int wrong_ = 0;
};

/// Irregular numbers between low and high, none of them near 0.
std::vector<double> numbers(std::size_t count, double low = -1, double high = 1);

/// df / dx, x being a number that f reads: (8 (f(+h) - f(-h)) - (f(+2h) - f(-2h))) / 12 h.
double slope(double& x, const std::function<double()>& f);

/// Names the lesson and ends with 1 where the program would abort: -D_GLIBCXX_ASSERTIONS sees indices
/// outside.
void name_aborts(const char* lesson);

}  // namespace lessons
