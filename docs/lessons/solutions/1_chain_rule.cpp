#include <cmath>
#include <ranges>

#include "lessons.h"

namespace lessons {

void run(const std::vector<Step>& tape, Array& values) {
  for (const Step& s : tape) {
    if (s.op == Step::add) values[s.out] = values[s.a] + values[s.b];
    if (s.op == Step::multiply) values[s.out] = values[s.a] * values[s.b];
    if (s.op == Step::sigmoid) values[s.out] = 1 / (1 + std::exp(-values[s.a]));
  }
}

void run_back(const std::vector<Step>& tape, const Array& values, Array& gradients) {
  for (const Step& s : tape | std::views::reverse) {
    const double g = gradients[s.out], y = values[s.out];
    if (s.op == Step::sigmoid) gradients[s.a] += g * y * (1 - y);
    if (s.op == Step::multiply) gradients[s.a] += g * values[s.b], gradients[s.b] += g * values[s.a];
    if (s.op == Step::add) gradients[s.a] += g, gradients[s.b] += g;
  }
}

}  // namespace lessons
