#include <cmath>

#include "lessons.h"

namespace lessons {

void adam_step(const Rates& r, long t, const Array& g, Array& m, Array& v, Array& x) {
  const double m_share = 1 - std::pow(r.beta1, t), v_share = 1 - std::pow(r.beta2, t);
  for (std::size_t i = 0; i < g.size(); ++i) {
    m[i] = r.beta1 * m[i] + (1 - r.beta1) * g[i];
    v[i] = r.beta2 * v[i] + (1 - r.beta2) * g[i] * g[i];
    x[i] -= r.rate * (m[i] / m_share) / (std::sqrt(v[i] / v_share) + r.epsilon);
  }
}

}  // namespace lessons
