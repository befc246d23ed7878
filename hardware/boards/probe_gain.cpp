#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "hardware/boards/probe.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kHeldS = 0.2, kHeldShare = 0.01;
constexpr std::size_t kHeldFrames = 3;
constexpr double kPressedNoise = 6, kPressedShare = 0.2, kStrong = 0.9;
constexpr double kLeastGain = 0.2, kMostGain = 5;

struct Press {
  int taxel = 0;
  double peak = 0, noise = 0;
};

// How far a taxel's signals went from rest, and how far they go by themselves.
Press press_of(const HeardFrames& frames, const Sensor& sensor, int taxel) {
  const auto channels = static_cast<std::size_t>(sensor.array.channels);
  std::vector<double> changes(frames.count), steps(frames.count - 1);
  for (std::size_t c = 0; c < channels; ++c) {
    const std::size_t s = static_cast<std::size_t>(taxel) * channels + c;
    const std::vector<float>& signal = frames.signals[s];
    for (std::size_t i = 0; i < frames.count; ++i) {
      changes[i] = std::hypot(changes[i], double{signal[i]} - double{sensor.rest[s]});
      if (i > 0) steps[i - 1] = std::hypot(steps[i - 1], double{signal[i]} - double{signal[i - 1]});
    }
  }
  const double held = std::min(kHeldShare * static_cast<double>(frames.count), kHeldS * sensor.rate_hz);
  const auto above = std::max(static_cast<std::size_t>(held), kHeldFrames);
  std::ranges::sort(changes, std::greater());
  return {taxel, changes[std::min(above, frames.count) - 1], quantile(steps, 0.75)};
}

}  // namespace

ProbeReport find_gain(std::span<const Heard> heard, const Sensor& sensor) {
  ProbeReport report;
  const HeardFrames frames = frames_of(sensor, heard);
  report.says.push_back(std::to_string(frames.count) + " frames to find gains from");
  if (frames.count <= 2 * kHeldFrames) return report;
  Sensor found = sensor;
  found.rest.clear();
  for (std::vector<float> signal : frames.signals) found.rest.push_back(median(signal));
  const std::vector<int> silent = sensor.silent();
  const auto among = [](int taxel, const std::vector<int>& taxels) {
    return std::ranges::find(taxels, taxel) != taxels.end();
  };
  std::vector<Press> presses;
  std::vector<double> peaks;
  for (int taxel = 0; taxel < sensor.array.taxels(); ++taxel)
    if (!among(taxel, silent)) {
      presses.push_back(press_of(frames, found, taxel));
      peaks.push_back(presses.back().peak);
    }
  const double least = kPressedShare * quantile(peaks, kStrong);
  std::vector<int> weak;
  peaks.clear();
  for (const Press& press : presses)
    if (press.peak > std::max(least, kPressedNoise * press.noise))
      peaks.push_back(press.peak);
    else
      weak.push_back(press.taxel);
  if (peaks.empty()) {
    report.says.emplace_back("nothing was pressed: press every taxel while it listens (--seconds)");
    return report;
  }
  const double usual = median(peaks);
  double lowest = kMostGain, highest = kLeastGain;
  found.gain.assign(sensor.array.signals(), 1);
  for (const Press& press : presses) {
    if (among(press.taxel, weak)) continue;
    const double gain = std::clamp(std::round(1e4 * usual / press.peak) / 1e4, kLeastGain, kMostGain);
    lowest = std::min(lowest, gain), highest = std::max(highest, gain);
    for (int c = 0; c < sensor.array.channels; ++c)
      found.gain[static_cast<std::size_t>(press.taxel * sensor.array.channels + c)] =
          static_cast<float>(gain);
  }
  report.says.push_back("gains of " + std::to_string(peaks.size()) + " taxels, " + format(lowest) + " to " +
                        format(highest) + ", from presses that changed a signal by " + format(usual, 3));
  if (!weak.empty())
    report.says.push_back("not pressed, or far more weakly than the others: taxels " +
                          nlohmann::json(weak).dump() +
                          " keep gain 1; press them as hard as the others, or name them in \"dead\"");
  found.check();
  report.draft = found;
  return report;
}

}  // namespace supertac
