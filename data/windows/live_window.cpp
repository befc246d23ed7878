#include "data/windows/live_window.h"

#include <algorithm>
#include <cmath>

#include "data/windows/transforms.h"
#include "io/numbers/text.h"

namespace supertac {
LiveWindow::LiveWindow(const LiveWindowSettings& settings)
    : settings_(settings),
      resampler_(settings.signals, settings.rate_hz, settings.scaling),
      ring_(static_cast<std::size_t>(settings.timesteps) * settings.signals),
      mean_(settings.signals),
      average_(settings.signals) {}

void LiveWindow::push(double time_s, std::span<const float> frame) {
  expect_values("live window", "frame", settings_.signals, frame.size());
  if (!std::isfinite(time_s) || !std::ranges::all_of(frame, [](float v) { return std::isfinite(v); })) return;
  if (!newest_s_ || std::abs(time_s - *newest_s_) > longest_silence_s(settings_.frame_period_s)) {
    if (newest_s_) ++gaps_;
    recent_s_.clear(), recent_.clear();
    resampler_.restart();
  } else if (time_s <= *newest_s_) {
    return;
  }
  newest_s_ = time_s;
  if (settings_.filter_s > 0) {
    average(time_s, frame);
    frame = average_;
  }
  if (settings_.timesteps == 1) resampler_.restart();  // each frame as it is, as WindowSet has it
  resampler_.add(time_s, frame, [&](std::size_t j, std::span<const float> sample) {
    const std::size_t slot = j % static_cast<std::size_t>(settings_.timesteps);
    std::ranges::copy(sample, ring_.begin() + static_cast<std::ptrdiff_t>(slot * settings_.signals));
  });
}

void LiveWindow::average(double time_s, std::span<const float> frame) {
  const double span_s = std::max(0.0, settings_.filter_s - 0.5 * settings_.frame_period_s);
  const auto old = std::ranges::lower_bound(recent_s_, time_s - span_s) - recent_s_.begin();
  recent_s_.erase(recent_s_.begin(), recent_s_.begin() + old);
  recent_.erase(recent_.begin(), recent_.begin() + old * static_cast<std::ptrdiff_t>(frame.size()));
  recent_s_.push_back(time_s);
  recent_.insert(recent_.end(), frame.begin(), frame.end());
  mean_.clear();
  for (std::size_t at = 0; at < recent_.size(); at += frame.size())
    mean_.add(std::span(recent_).subspan(at, frame.size()));
  mean_.write(average_);
}

bool LiveWindow::window(std::span<float> out) const {
  expect_values("live window", "window", ring_.size(), out.size());
  const auto timesteps = static_cast<std::size_t>(settings_.timesteps);
  if (resampler_.samples() < timesteps) return false;
  const auto oldest = static_cast<std::ptrdiff_t>(resampler_.samples() % timesteps * settings_.signals);
  std::ranges::rotate_copy(ring_, ring_.begin() + oldest, out.begin());
  if (settings_.scaling.per_window) normalise_window(out, settings_.signals);
  return true;
}

}  // namespace supertac
