// Lesson 7: Adam. The moments are kept; the step is yours.
#include <cmath>

#include "lessons.h"

namespace lessons {

void adam_step(const Rates& r, long /*t*/, const Array& g, Array& m, Array& v, Array& /*x*/) {
  for (std::size_t i = 0; i < g.size(); ++i) {
    m[i] = r.beta1 * m[i] + (1 - r.beta1) * g[i];
    v[i] = r.beta2 * v[i] + (1 - r.beta2) * g[i] * g[i];
    // Both began at 0 and are too small at first. How much too small after t steps? Move x[i].
  }
}

}  // namespace lessons
