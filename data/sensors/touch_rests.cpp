#include "data/sensors/touch_rests.h"

#include <algorithm>
#include <cmath>

#include "io/numbers/median.h"

namespace supertac {

std::vector<double> rests_between_touches(std::span<const std::vector<float>> signals, int channels,
                                          bool rises) {
  const std::size_t frames = signals.empty() ? 0 : signals.front().size();
  std::vector<double> total(frames), steps;
  for (const std::vector<float>& signal : signals) {
    std::vector<float> values = signal;
    const double middle = frames > 0 ? double{median(values)} : 0;
    for (std::size_t f = 0; f < frames; ++f) {
      const double away = double{signal[f]} - middle;
      total[f] += channels > 1 ? std::abs(away) : rises ? away : -away;
    }
  }
  for (std::size_t f = 1; f < frames; ++f) steps.push_back(std::abs(total[f] - total[f - 1]));
  std::vector<double> sorted = total;
  // A quarter of the differences of two normal numbers are below 0.4506 deviations.
  const double noise = steps.empty() ? 0 : quantile(steps, 0.25) / 0.4506;
  const double most = frames > 0 ? quantile(sorted, 0.1) + 4 * noise : 0;
  std::vector<double> rests;
  for (const std::vector<float>& signal : signals) {
    std::vector<float> free;
    for (std::size_t f = 0; f < frames; ++f)
      if (total[f] <= most) free.push_back(signal[f]);
    rests.push_back(free.empty() ? 0 : double{median(free)});
  }
  return rests;
}

}  // namespace supertac
