#include "lessons.h"

namespace lessons {

void channel_mean(const Image& s, const Array& x, Array& mean) {
  for (std::size_t at = 0; at < x.size(); ++at)
    mean[at % s.channels] += x[at] / static_cast<double>(s.pixels);
}

void channel_mean_gradient(const Image& s, const Array& gmean, Array& gx) {
  for (std::size_t at = 0; at < gx.size(); ++at)
    gx[at] += gmean[at % s.channels] / static_cast<double>(s.pixels);
}

void gated_sum(const Image& s, const Array& a, const Array& x, const Array& gate, Array& y) {
  for (std::size_t at = 0; at < x.size(); ++at) y[at] = a[at] + x[at] * gate[at % s.channels];
}

void gated_sum_gradient(const Image& s, const Array& x, const Array& gate, const Array& gy, Array& ga,
                        Array& gx, Array& ggate) {
  for (std::size_t at = 0; at < gy.size(); ++at) {
    ga[at] += gy[at];
    gx[at] += gy[at] * gate[at % s.channels];
    ggate[at % s.channels] += gy[at] * x[at];
  }
}

}  // namespace lessons
