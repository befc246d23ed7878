#include "data/registration/apply_registration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// Frames lost where nothing moved: a straight line from the signals before to those behind. Where the finger
// was in each of them is left open.
void fill_loss(const Registration& registration, Recording& recording) {
  std::vector<double>& time = recording.time_s;
  const auto found = std::lower_bound(time.begin(), time.end(), registration.lost_at_s);
  const auto at = static_cast<std::size_t>(found - time.begin());
  for (std::size_t i = at; i < time.size(); ++i) time[i] += registration.lost_s;
  if (at < 2 || at == time.size()) return;  // nothing on one side
  const std::size_t signals = recording.array.signals();
  const double step = (time[at - 1] - time[0]) / static_cast<double>(at - 1), gap = time[at] - time[at - 1];
  const auto lost = static_cast<std::size_t>(std::max(0.0, gap / step - 1));
  std::vector<double> times(lost);
  std::vector<float> volts(lost * signals);
  std::vector<float> places(2 * lost, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t k = 0; k < lost; ++k) {
    const double part = static_cast<double>(k + 1) / static_cast<double>(lost + 1);
    times[k] = time[at - 1] + part * gap;
    for (std::size_t s = 0; s < signals; ++s)
      volts[k * signals + s] = std::lerp(recording.signals[(at - 1) * signals + s],
                                         recording.signals[at * signals + s], static_cast<float>(part));
    places[2 * k] = recording.position_mm[0];
  }
  const auto before = static_cast<std::ptrdiff_t>(at);
  time.insert(time.begin() + before, times.begin(), times.end());
  recording.signals.insert(recording.signals.begin() + before * static_cast<std::ptrdiff_t>(signals),
                           volts.begin(), volts.end());
  recording.position_mm.insert(recording.position_mm.begin() + 2 * before, places.begin(), places.end());
}

}  // namespace

void apply(const Registration& registration, Recording& recording, double x_mm) {
  const bool nominal = value_or(recording.metadata, "time_base") == "nominal";
  const std::size_t n = recording.frames();
  recording.position_mm.resize(2 * n);
  const auto x = static_cast<float>(x_mm);
  for (std::size_t i = 0; i < n; ++i) {
    const double y = registration.y_mm(recording.time_s[i]);
    const bool known =
        recording.time_s[i] >= registration.valid_from_s && recording.time_s[i] <= registration.valid_until_s;
    recording.position_mm[2 * i] = x;
    recording.position_mm[2 * i + 1] = known ? static_cast<float>(std::clamp(y, 0.0, rig::kPlateLengthMm))
                                             : std::numeric_limits<float>::quiet_NaN();
  }
  if (registration.lost_s > 0) fill_loss(registration, recording);
  if (nominal && registration.reliable) {  // the finger's speed is known better than the rate of the lines
    const double speed = recording.speed_mm_s > 0 ? recording.speed_mm_s : rig::kSlideMmS;
    for (double& t : recording.time_s) t *= registration.rate / speed;
    recording.metadata["time_base"] = "registered";
  }
  recording.metadata["registration_start_mm"] = format(registration.start_mm, 3);
  recording.metadata["registration_rate"] = format(registration.rate, 4);
  recording.metadata["registration_residual_mm"] = format(registration.residual, 3);
  recording.metadata["registration_reliable"] = registration.reliable ? "yes" : "no";
  recording.metadata["registration_reason"] = registration.reason;
  recording.metadata["registration_shift_mm"] = format(registration.shift_mm, 3);
  recording.metadata["registration_stretch_mm"] = format(registration.stretch_mm, 3);
  recording.metadata["registration_lost_s"] = format(registration.lost_s, 3);
}

}  // namespace supertac
