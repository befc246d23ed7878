// Lesson 1: the chain rule. The values are there; the way back is yours.
#include <cmath>

#include "lessons.h"

namespace lessons {

void run(const std::vector<Step>& tape, Array& values) {
  for (const Step& s : tape) {
    if (s.op == Step::add) values[s.out] = values[s.a] + values[s.b];
    if (s.op == Step::multiply) values[s.out] = values[s.a] * values[s.b];
    if (s.op == Step::sigmoid) values[s.out] = 1 / (1 + std::exp(-values[s.a]));
  }
}

void run_back(const std::vector<Step>& /*tape*/, const Array& /*values*/, Array& /*gradients*/) {
  // gradients[i] is to become dL/d values[i]. The last one is 1 already, the others are 0.
  // Take the steps from the last to the first; each knows dL/d out, and adds what it means for a and b.
}

}  // namespace lessons
