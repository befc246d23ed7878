// Faults of a data set that no single file shows.
#include <algorithm>

#include "data/windows/split.h"
#include "data/windows/windows.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kLookedAt = 4000;
constexpr float kStill = 0.02F;
constexpr double kAtTheEnd = 0.05;

}  // namespace

std::vector<std::string> remarks_on(const WindowSet& windows, std::span<const std::uint32_t> chosen) {
  if (chosen.empty()) return {};
  const std::size_t signals = windows.array().signals();
  std::vector<float> low(signals, 1e30F), high(signals, -1e30F), swings(signals);
  std::size_t at_the_end = 0, count = 0;
  for (const std::uint32_t i : evenly_spaced(chosen, kLookedAt)) {
    const std::vector<float> frame = windows.shown_frame(i);
    for (std::size_t s = 0; s < signals; ++s, ++count) {
      low[s] = std::min(low[s], frame[s]), high[s] = std::max(high[s], frame[s]);
      at_the_end += frame[s] >= 1 ? 1 : 0;
    }
  }
  for (std::size_t s = 0; s < signals; ++s) swings[s] = high[s] - low[s];
  const float limit = kStill * median(std::vector(swings));
  std::vector<std::size_t> still;  // beside the others; all when none moves
  for (std::size_t s = 0; s < signals; ++s)
    if (swings[s] <= limit) still.push_back(s);
  const bool touched = std::ranges::any_of(chosen, [&](std::uint32_t i) { return windows.contact(i); });
  const double share_at_the_end = static_cast<double>(at_the_end) / static_cast<double>(count);
  std::vector<std::string> remarks;
  if (still.size() == signals)
    remarks.emplace_back(
        "no signal changes: the sensor is dead, or its signals lie outside the model's range");
  else if (!still.empty())
    remarks.push_back("signals " + joined(still, ", ") + " never change: dead taxels, or stuck ones");
  if (share_at_the_end >= kAtTheEnd)
    remarks.push_back(format(100 * share_at_the_end, 1) +
                      " % of the signals lie at the end of the model's range: saturated, or clipped");
  if (!touched)
    remarks.emplace_back("every truth is 0 everywhere: nothing can be learnt or scored in contact");
  return remarks;
}

}  // namespace supertac
