#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>

#include "data/frames/probe.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kHeldS = 0.2, kHeldShare = 0.01;
constexpr std::size_t kHeldFrames = 3;
constexpr double kPressedNoise = 6, kPressedShare = 0.2, kStrong = 0.9, kLeastGain = 0.2, kMostGain = 5;

// peak_k, or 0 where it is noise.
double peak_of(const HeardFrames& frames, const Sensor& sensor, std::size_t taxel) {
  const auto channels = static_cast<std::size_t>(sensor.array.channels);
  std::vector<double> changes(frames.count), steps(frames.count - 1);
  for (std::size_t s = taxel * channels; s < (taxel + 1) * channels; ++s) {
    const std::vector<float>& signal = frames.signals[s];
    for (std::size_t i = 0; i < frames.count; ++i) {
      changes[i] = std::hypot(changes[i], double{signal[i]} - double{sensor.rest[s]});
      if (i > 0) steps[i - 1] = std::hypot(steps[i - 1], double{signal[i]} - double{signal[i - 1]});
    }
  }
  const double held = std::min(kHeldShare * static_cast<double>(frames.count), kHeldS * sensor.rate_hz);
  std::ranges::sort(changes, std::greater());
  const double peak = changes[std::max(static_cast<std::size_t>(held), kHeldFrames) - 1];
  return peak > kPressedNoise * quantile(steps, 0.75) ? peak : 0;
}

}  // namespace

ProbeReport find_gain(std::span<const Heard> heard, const Sensor& sensor) {
  const HeardFrames frames = frames_of(sensor, heard);
  ProbeReport report{{std::to_string(frames.count) + " frames to find gains from"}, {}};
  if (frames.count <= kHeldFrames) return report;
  Sensor found = sensor;
  found.rest.clear();
  for (std::vector<float> signal : frames.signals) found.rest.push_back(median(signal));
  const std::vector<int> silent = sensor.silent();
  const auto says = [&](int taxel) { return std::ranges::find(silent, taxel) == silent.end(); };
  std::vector<double> peaks, pressed;  // of silent taxels 0
  for (int taxel = 0; taxel < sensor.array.taxels(); ++taxel)
    peaks.push_back(says(taxel) ? peak_of(frames, found, static_cast<std::size_t>(taxel)) : 0);
  const double least = kPressedShare * quantile(std::vector(peaks), kStrong);
  std::ranges::copy_if(peaks, std::back_inserter(pressed), [&](double peak) { return peak > least; });
  if (pressed.empty()) {
    report.says.emplace_back("nothing was pressed: press every taxel while it listens (--seconds)");
    return report;
  }
  const double usual = median(pressed);
  const auto gain_of = [&](double peak) {
    return std::clamp(std::round(1e4 * usual / peak) / 1e4, kLeastGain, kMostGain);
  };
  std::vector<int> weak;
  found.gain.clear();
  for (int taxel = 0; taxel < sensor.array.taxels(); ++taxel) {
    const double peak = peaks[static_cast<std::size_t>(taxel)];
    if (peak <= least && says(taxel)) weak.push_back(taxel);
    found.gain.insert(found.gain.end(), static_cast<std::size_t>(sensor.array.channels),
                      peak > least ? static_cast<float>(gain_of(peak)) : 1);
  }
  const auto [lowest, highest] = std::ranges::minmax(pressed);
  report.says.push_back("gains of " + std::to_string(pressed.size()) + " taxels, " +
                        format(gain_of(highest)) + " to " + format(gain_of(lowest)) +
                        ", from presses that changed a signal by " + format(usual, 3));
  if (!weak.empty())
    report.says.push_back("not pressed, or far more weakly than the others: taxels " +
                          nlohmann::json(weak).dump() +
                          " keep gain 1; press them as hard as the others, or name them in \"dead\"");
  found.check();
  report.draft = found;
  return report;
}

}  // namespace supertac
