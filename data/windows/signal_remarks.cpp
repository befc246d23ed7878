#include "data/windows/signal_remarks.h"

#include <algorithm>

#include "data/windows/split.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kLookedAt = 4000;
constexpr float kStill = 0.02F;
constexpr double kAtTheEnd = 0.05;

/// Smallest and largest value of each signal.
class SwingRanges {
 public:
  explicit SwingRanges(std::size_t signals) : low_(signals, 1e30F), high_(signals, -1e30F) {}
  void add(std::span<const float> frame) {
    for (std::size_t s = 0; s < low_.size(); ++s) {
      low_[s] = std::min(low_[s], frame[s]), high_[s] = std::max(high_[s], frame[s]);
      at_the_end_ += frame[s] >= 1 ? 1 : 0, ++count_;
    }
  }
  double share_at_the_end() const { return static_cast<double>(at_the_end_) / static_cast<double>(count_); }
  /// Those that stand still beside the others; all when none moves.
  std::vector<std::size_t> still() const {
    std::vector<float> swings;
    for (std::size_t s = 0; s < low_.size(); ++s) swings.push_back(high_[s] - low_[s]);
    std::vector<float> sorted = swings;
    const float limit = kStill * median(sorted);
    std::vector<std::size_t> found;
    for (std::size_t s = 0; s < swings.size(); ++s)
      if (swings[s] <= limit) found.push_back(s);
    return found;
  }

 private:
  std::vector<float> low_, high_;
  std::size_t at_the_end_ = 0, count_ = 0;
};

}  // namespace

std::vector<std::string> remarks_on(const WindowSet& windows, std::span<const std::uint32_t> chosen) {
  if (chosen.empty()) return {};
  SwingRanges swings(windows.array().signals());
  bool touched = false;
  for (const std::uint32_t i : evenly_spaced(chosen, kLookedAt)) swings.add(windows.shown_frame(i));
  for (const std::uint32_t i : chosen) touched = touched || windows.contact(i);
  std::vector<std::string> remarks;
  const std::vector<std::size_t> still = swings.still();
  if (still.size() == windows.array().signals())
    remarks.emplace_back(
        "no signal changes: the sensor is dead, or its signals lie outside the model's range");
  else if (!still.empty())
    remarks.push_back("signals " + joined(still, ", ") + " never change: dead taxels, or stuck ones");
  if (swings.share_at_the_end() >= kAtTheEnd)
    remarks.push_back(format(100 * swings.share_at_the_end(), 1) +
                      " % of the signals lie at the end of the model's range: saturated, or clipped");
  if (!touched)
    remarks.emplace_back("every truth is 0 everywhere: nothing can be learnt or scored in contact");
  return remarks;
}

}  // namespace supertac
