// Lesson 4: channel attention. Its gates look at the mean of each channel.
#include "lessons.h"

namespace lessons {

void channel_mean(const Image& s, const Array& x, Array& mean) {
  for (std::size_t at = 0; at < x.size(); ++at)
    mean[at % s.channels] += x[at] / static_cast<double>(s.pixels);
}

void channel_mean_gradient(const Image& /*s*/, const Array& /*gmean*/, Array& /*gx*/) {
  // Every pixel has the same share in its channel's mean.
}

void gated_sum(const Image& s, const Array& a, const Array& x, const Array& gate, Array& y) {
  for (std::size_t at = 0; at < x.size(); ++at) y[at] = a[at] + x[at] * gate[at % s.channels];
}

void gated_sum_gradient(const Image& /*s*/, const Array& /*x*/, const Array& /*gate*/, const Array& /*gy*/,
                        Array& /*ga*/, Array& /*gx*/, Array& /*ggate*/) {
  // One gate serves all pixels of its channel.
}

}  // namespace lessons
