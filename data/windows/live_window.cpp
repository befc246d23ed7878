#include "data/windows/live_window.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "data/windows/transforms.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

LiveWindowSettings checked(LiveWindowSettings s) {
  const auto require = [](bool holds, const char* argument, const char* expected, double found) {
    if (!holds) throw std::invalid_argument(refusal("live window", argument, expected, format(found)));
  };
  require(s.signals >= 1, "signals", "1 or more", static_cast<double>(s.signals));
  require(s.timesteps >= 1, "timesteps", "1 or more", static_cast<double>(s.timesteps));
  require(s.rate_hz > 0, "rate_hz", "more than 0", s.rate_hz);
  require(s.frame_period_s > 0, "frame_period_s", "more than 0", s.frame_period_s);
  require(s.max_gap_s > 0, "max_gap_s", "more than 0", s.max_gap_s);
  require(std::abs(s.scaling.span) > 0, "scaling.span", "a number other than 0", s.scaling.span);
  require(s.filter_s >= 0, "filter_s", "0 or more", s.filter_s);
  s.max_gap_s = std::max(s.max_gap_s, kGapPeriods * s.frame_period_s);
  return s;
}

}  // namespace

LiveWindow::LiveWindow(const LiveWindowSettings& settings)
    : settings_(checked(settings)),
      resampler_(settings.signals, settings.rate_hz, settings.scaling),
      ring_(static_cast<std::size_t>(settings.timesteps) * settings.signals),
      mean_(settings.signals),
      average_(settings.signals) {}

void LiveWindow::push(double time_s, std::span<const float> frame) {
  if (frame.size() != settings_.signals)
    throw std::invalid_argument("live window: a frame has " + std::to_string(settings_.signals) +
                                " signals, got " + std::to_string(frame.size()));
  if (!std::isfinite(time_s) ||
      !std::all_of(frame.begin(), frame.end(), [](float v) { return std::isfinite(v); })) {
    ++counters_.damaged;
    return;
  }
  if (!newest_s_ || std::abs(time_s - *newest_s_) > settings_.max_gap_s) {
    if (newest_s_) ++counters_.gaps;
    recent_s_.clear(), recent_.clear();
    resampler_.restart();
  } else if (time_s <= *newest_s_) {
    ++counters_.late;
    return;
  }
  ++counters_.frames;
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
  if (out.size() != ring_.size())
    throw std::invalid_argument("live window: needs room for " + std::to_string(ring_.size()) +
                                " values, got " + std::to_string(out.size()));
  const auto timesteps = static_cast<std::size_t>(settings_.timesteps);
  if (resampler_.samples() < timesteps) return false;
  const auto oldest = static_cast<std::ptrdiff_t>(resampler_.samples() % timesteps * settings_.signals);
  std::ranges::rotate_copy(ring_, ring_.begin() + oldest, out.begin());
  if (settings_.scaling.per_window) normalise_window(out, settings_.signals);
  return true;
}

}  // namespace supertac
