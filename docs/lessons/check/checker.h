// What the lessons are checked with: differences, and sentences about what they find.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
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

inline std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

inline std::string place_of(const Compared& c, std::size_t place) {
  if (c.right.size() == 1) return c.name;
  std::string text;
  for (std::size_t k = c.shape.size(); k-- > 0; place /= static_cast<std::size_t>(c.shape[k]))
    text = std::to_string(place % static_cast<std::size_t>(c.shape[k])) + (text.empty() ? "" : "," + text);
  return c.name + " [" + text + "]";
}

inline double largest_of(const Compared& c) {
  double largest = 1e-3;
  for (const double e : c.right) largest = std::max(largest, std::abs(e));
  return largest;
}

// The factor that all wrong entries share, or NaN.
inline double common_factor(const Compared& c, const std::vector<std::size_t>& wrong) {
  double factor = std::nan("");
  const double least = 1e-6 * largest_of(c);
  for (const std::size_t i : wrong) {
    if (std::abs(c.right[i]) < least) return std::nan("");
    const double f = c.yours[i] / c.right[i];
    if (std::isnan(factor)) factor = f;
    if (!(std::abs(f - factor) <= 1e-4 * std::max(1.0, std::abs(factor)))) return std::nan("");
  }
  return factor;
}

/// "gw [1,0]: yours 2, differences give 4 (22 of 22 entries are wrong, by the factor 0.5)": the worst entry,
/// and the factor where all have one. Empty when all agree to 1e-6 of the largest.
inline std::string finding(const Compared& c, const std::string& from) {
  if (c.yours.size() != c.right.size())
    return c.name + " has " + std::to_string(c.yours.size()) + " entries, " + std::to_string(c.right.size()) +
           " are expected";
  std::vector<std::size_t> wrong;
  std::size_t worst = 0;
  const double tolerance = 1e-6 * largest_of(c);
  const auto error = [&](std::size_t i) {
    const double e = std::abs(c.yours[i] - c.right[i]);
    return std::isfinite(e) ? e : 1e300;
  };
  for (std::size_t i = 0; i < c.right.size(); ++i) {
    if (error(i) <= tolerance) continue;
    if (wrong.empty() || error(i) > error(worst)) worst = i;
    wrong.push_back(i);
  }
  if (wrong.empty()) return {};
  const double factor = common_factor(c, wrong);
  return place_of(c, worst) + ": yours " + number(c.yours[worst]) + ", " + from + " " +
         number(c.right[worst]) + " (" + std::to_string(wrong.size()) + " of " +
         std::to_string(c.right.size()) + " entries are wrong" +
         (std::isnan(factor) ? "" : ", by the factor " + number(factor)) + ")";
}

/// Prints a line for each array. Counts what is wrong.
class Report {
 public:
  void add(const std::string& what, const Compared& array, const std::string& from = "it should be") {
    const std::string found = finding(array, from), before = what == array.name ? "" : what + ", ";
    if (found.empty()) {
      std::printf("  right: %s%s (%zu)\n", before.c_str(), array.name.c_str(), array.right.size());
    } else {
      std::printf("  wrong: %s%s\n", before.c_str(), found.c_str());
      ++wrong_;
    }
  }
  void add(const std::string& what, double yours, double right) { add(what, {what, {1}, {yours}, {right}}); }
  int wrong() const { return wrong_; }

 private:
  int wrong_ = 0;
};

/// Irregular numbers between low and high, none of them near 0.
inline std::vector<double> numbers(std::size_t count, double low = -1, double high = 1) {
  std::vector<double> all;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = low + (high - low) * std::fmod(0.61803398875 * static_cast<double>(i + 1) + 0.1, 1.0);
    all.push_back(std::abs(x) < 0.05 ? x + 0.1 : x);
  }
  return all;
}

/// df / dx, x being a number that f reads: (8 (f(+h) - f(-h)) - (f(+2h) - f(-2h))) / 12 h.
inline double slope(double& x, const std::function<double()>& f) {
  constexpr double h = 1e-4;
  const double middle = x;
  const auto at = [&](double offset) { return x = middle + offset, f(); };
  const double found = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
  x = middle;
  return found;
}

/// Names the lesson and ends with 1 where the program would abort: -D_GLIBCXX_ASSERTIONS sees indices
/// outside.
inline void name_aborts(const char* lesson) {
  static const char* lesson_name;
  lesson_name = lesson;
  std::signal(SIGABRT, [](int) {
    const char text[] =
        ": an index outside its array, or an exception, in the check after the last line above; the lesson "
        "ends here\n";
    std::fflush(stdout);
    [[maybe_unused]] ssize_t n = ::write(1, "  wrong: ", 9);
    n = ::write(1, lesson_name, std::strlen(lesson_name));
    n = ::write(1, text, sizeof text - 1);
    ::_exit(1);
  });
}

}  // namespace lessons
