#include "docs/lessons/check/checker.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace lessons {
namespace {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::vector<int> indices_of(const Compared& c, std::size_t place) {
  std::vector<int> at(c.shape.size());
  for (std::size_t k = at.size(); k-- > 0; place /= static_cast<std::size_t>(c.shape[k]))
    at[k] = static_cast<int>(place) % c.shape[k];
  return at;
}

std::string place_of(const Compared& c, std::size_t place) {
  std::string text;
  for (const int i : indices_of(c, place)) text += (text.empty() ? "" : ",") + std::to_string(i);
  return c.right.size() == 1 ? c.name : c.name + " [" + text + "]";
}

double largest_of(const Compared& c) {
  double largest = 1e-3;
  for (const double e : c.right) largest = std::max(largest, std::abs(e));
  return largest;
}

bool close(double a, double b, double scale) { return std::abs(a - b) <= 1e-6 * scale; }

// The factor that all wrong entries share, or NaN.
double common_factor(const Compared& c, const std::vector<std::size_t>& wrong) {
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

std::string about_factor(double f) {
  if (f == 0) return "nothing arrives there: is a line missing, or a slope 0?";
  if (std::abs(f + 1) < 1e-4) return "the sign is turned.";
  if (std::abs(f - 0.5) < 1e-4)
    return "half of what it should be: is it set (=) where it should be added (+=), or is a factor 2 "
           "missing?";
  if (std::abs(f - 2) < 1e-4) return "twice too large: is a factor 1/2 missing, or is it added twice?";
  const double n = std::abs(f) > 1 ? f : 1 / f;
  if (std::abs(n - std::round(n)) < 1e-3)
    return number(std::abs(n)) + " times too " + (std::abs(f) > 1 ? "large" : "small") +
           (f < 0 ? ", with the wrong sign" : "") + ": is a factor missing (1/n, a side), or there twice?";
  return "all by the same factor, " + number(f) + ".";
}

// Whether the wrong entries are all at the first or the last index of an axis: its name, or nothing.
std::string edge_of(const Compared& c, const std::vector<std::size_t>& wrong) {
  for (std::size_t axis = 0; axis < c.shape.size(); ++axis) {
    const int last = c.shape[axis] - 1;
    const bool edge = std::ranges::all_of(wrong, [&](std::size_t i) {
      const int at = indices_of(c, i)[axis];
      return at == 0 || at == last;
    });
    if (edge && last > 1) return std::to_string(axis);
  }
  return {};
}

}  // namespace

std::string cause_of(const Compared& c, const std::vector<std::size_t>& wrong) {
  const double scale = largest_of(c);
  const std::size_t n = c.right.size();
  const bool all = wrong.size() == n;
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::ranges::all_of(c.yours, finite))
    return "a number is not finite: a division by 0, or exp of a large one?";
  if (!c.hint.empty()) return c.hint;
  if (const double f = common_factor(c, wrong);
      !std::isnan(f) && (all || n == 1 || wrong.size() > 1 || f != 0))
    return about_factor(f);
  std::vector<double> mine = c.yours, right = c.right;
  std::ranges::sort(mine), std::ranges::sort(right);
  const bool same_numbers =
      std::ranges::equal(mine, right, [&](double a, double b) { return close(a, b, scale); });
  if (same_numbers && n > 1)
    return "the right numbers in wrong places: are two indices or two axes exchanged?";
  for (const int shift : {1, -1}) {
    std::size_t agree = 0;
    for (std::size_t i = 1; i + 1 < n; ++i)
      agree += close(c.yours[i], c.right[i + static_cast<std::size_t>(shift)], scale);
    if (n > 3 && agree + 2 == n)
      return "everything is one place off: does an index begin or end one too far?";
  }
  if (const std::string axis = edge_of(c, wrong); !all && !axis.empty())
    return "only at the ends of axis " + axis + ": look at the padding, and at where a loop begins and ends.";
  const auto nothing = [&](std::size_t i) { return c.yours[i] == 0; };
  if (std::ranges::all_of(wrong, nothing))
    return "some get nothing at all: does a loop or a condition leave them out?";
  const double off = c.yours[wrong[0]] - c.right[wrong[0]];
  const bool constant = std::ranges::all_of(
      wrong, [&](std::size_t i) { return std::abs(c.yours[i] - c.right[i] - off) < 1e-6 * scale; });
  if (constant && wrong.size() > 1) return "all are off by the same number, " + number(off) + ".";
  return "not one factor for all: is a term of the sum missing (= for +=), or another index or value meant?";
}

std::string finding(const Compared& c, const std::string& from) {
  if (c.yours.size() != c.right.size())
    return c.name + " has " + std::to_string(c.yours.size()) + " entries, " + std::to_string(c.right.size()) +
           " are expected: look at the shape.";
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
  return place_of(c, worst) + ": yours " + number(c.yours[worst]) + ", " + from + " " +
         number(c.right[worst]) + " (" + std::to_string(wrong.size()) + " of " +
         std::to_string(c.right.size()) + " entries are wrong): " + cause_of(c, wrong);
}

void Report::add(const std::string& what, const Compared& array, const std::string& from) {
  const std::string found = finding(array, from), before = what == array.name ? "" : what + ", ";
  if (found.empty()) {
    std::printf("  right: %s%s (%zu)\n", before.c_str(), array.name.c_str(), array.right.size());
  } else {
    std::printf("  wrong: %s%s\n", before.c_str(), found.c_str());
    ++wrong_;
  }
}

void Report::gradients(const std::string& what, const std::vector<std::string>& names,
                       const std::vector<supertac::Tensor>& inputs,
                       const std::function<supertac::Variable(const std::vector<supertac::Variable>&)>& f) {
  const supertac::GradientReport report = supertac::check_gradients(f, inputs, {.names = names});
  std::vector<Compared> arrays;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    Compared& c = arrays.emplace_back(Compared{"the gradient of " + names[k], {}, {}, {}});
    for (const supertac::Dim n : inputs[k].shape().dims()) c.shape.push_back(static_cast<int>(n));
  }
  for (const supertac::GradientEntry& e : report.all) {
    arrays[e.input].yours.push_back(e.analytic);
    // What differences leave behind of rounding is no gradient.
    arrays[e.input].right.push_back(e.relative_error < 1e-6 ? e.analytic : e.numeric);
  }
  gradients(what, arrays);
}

void Report::gradients(const std::string& what, std::vector<Compared> arrays) {
  const auto as = [](const Compared& mine, const Compared& other) {
    return finding({"", {}, mine.yours, other.right}, "").empty();
  };
  for (Compared& mine : arrays)
    for (const Compared& other : arrays)
      if (&mine != &other && !as(mine, mine) && as(mine, other) && as(other, mine))
        mine.hint = "these are the numbers of " + other.name + ": are the two exchanged?";
  for (const Compared& c : arrays) add(what, c, "differences give");
}

supertac::Tensor numbers(const supertac::Shape& shape, double low, double high) {
  supertac::Tensor t(shape);
  for (supertac::Dim i = 0; i < t.size(); ++i) {
    const double unit = std::fmod(0.61803398875 * static_cast<double>(i + 1) + 0.1, 1.0);
    const double x = low + (high - low) * unit;
    t.data()[i] = std::abs(x) < 0.05 ? x + 0.1 : x;
  }
  return t;
}

static const char* lesson_name = "";

void name_aborts(const char* lesson) {
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
