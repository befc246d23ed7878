#include "data/sensors/frame_load.h"

#include <cmath>

namespace supertac {

FrameLoad load_of(std::span<const float> signals, int channels, const SignalScale& scale) {
  FrameLoad load;
  const auto of_taxel = static_cast<std::size_t>(channels);
  for (; signals.size() >= of_taxel; signals = signals.subspan(of_taxel)) {
    double squares = 0, share = 0;
    for (const float signal : signals.first(of_taxel)) {
      share = (scale.rest - static_cast<double>(signal)) / scale.span;
      squares += share * share;
      load.saturated += std::abs(share) >= 1;
    }
    load.total_force += channels == 1 ? share : std::sqrt(squares);
  }
  return load;
}

}  // namespace supertac
