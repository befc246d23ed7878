#include "data/live_window.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "data/levelling.h"

namespace supertac {
namespace {

// How far before the newest frame a window may end.
constexpr double kLookBackS = 0.1;

void check(const LiveWindowSettings& s) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("live window: " + what); };
  if (s.timesteps < 1) fail("timesteps must be at least 1, got " + std::to_string(s.timesteps));
  if (!(s.rate_hz > 0) || !(s.frame_period_s > 0) || !(s.max_gap_s > 0) || !(s.scaling.span_volts > 0))
    fail("rate_hz, frame_period_s, max_gap_s and span_volts must be positive, got " +
         std::to_string(s.rate_hz) + ", " + std::to_string(s.frame_period_s) + ", " +
         std::to_string(s.max_gap_s) + " and " + std::to_string(s.scaling.span_volts));
  if (!(s.filter_s >= 0)) fail("filter_s must not be negative, got " + std::to_string(s.filter_s));
}

double window_s(const LiveWindowSettings& s) { return s.timesteps / s.rate_hz; }

}  // namespace

void LiveWindow::Recent::push(const Frame& frame) {
  frames_.push_back(frame);
  while (frames_[first_].time_s < frame.time_s - span_s_) ++first_;
  if (2 * first_ < frames_.size()) return;
  frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(first_));
  first_ = 0;
}

void LiveWindow::Recent::clear() {
  frames_.clear();
  first_ = 0;
}

// A sample without frames repeats an older one, whose frames may lie a gap and a period before the window.
LiveWindow::LiveWindow(const LiveWindowSettings& settings)
    : settings_((check(settings), settings)),
      raw_(std::max(0.0, settings.filter_s - 0.5 * settings.frame_period_s)),
      filtered_(window_s(settings) + settings.max_gap_s + 2 / settings.rate_hz + kLookBackS) {}

bool LiveWindow::begins_anew(double time_s) const {
  if (filtered_.frames().empty()) return true;
  return std::abs(time_s - filtered_.frames().back().time_s) > settings_.max_gap_s;
}

void LiveWindow::push(double time_s, std::span<const float, kTaxels> volts) {
  if (!std::isfinite(time_s) ||
      !std::all_of(volts.begin(), volts.end(), [](float v) { return std::isfinite(v); })) {
    ++counters_.damaged;
    return;
  }
  if (begins_anew(time_s)) {
    if (!filtered_.frames().empty()) ++counters_.gaps;
    raw_.clear();
    filtered_.clear();
    run_begin_s_ = time_s;
  } else if (time_s <= filtered_.frames().back().time_s) {
    ++counters_.late;
    return;
  }
  ++counters_.frames;
  Frame frame{time_s, {}};
  std::copy(volts.begin(), volts.end(), frame.volts.begin());
  if (settings_.filter_s > 0) {
    raw_.push(frame);
    FrameMean mean;
    for (const Frame& recent : raw_.frames()) mean.add(recent.volts);
    frame.volts = mean.volts();
  }
  filtered_.push(frame);
}

double LiveWindow::end_s() const {
  const auto frames = filtered_.frames();
  if (frames.empty()) return 0;
  return frames.back().time_s + 0.5 * std::min(settings_.frame_period_s, 1 / settings_.rate_hz);
}

bool LiveWindow::window_until(double end_s, std::span<float> out) const {
  const auto timesteps = static_cast<std::ptrdiff_t>(settings_.timesteps);
  if (out.size() != static_cast<size_t>(timesteps) * kTaxels)
    throw std::invalid_argument("live window: needs room for " + std::to_string(timesteps * kTaxels) +
                                " values, got " + std::to_string(out.size()));
  const std::span<const Frame> frames = filtered_.frames();
  const double since_begin = (end_s - run_begin_s_) * settings_.rate_hz;
  if (frames.empty() || since_begin < static_cast<double>(timesteps) - 0.5 - kCellSlack) return false;

  // Sample k, counted back from the window's end, that a frame belongs to; negative: later than the window.
  const auto sample = [&](const Frame& frame) {
    return static_cast<std::ptrdiff_t>(std::floor((end_s - frame.time_s) * settings_.rate_hz + kCellSlack));
  };
  auto at = std::partition_point(frames.begin(), frames.end(),
                                 [&](const Frame& frame) { return sample(frame) >= timesteps; });
  if (at != frames.begin() && (at == frames.end() || sample(*at) < timesteps - 1)) {
    // The oldest sample has no frames: it repeats the last one before the window.
    const std::ptrdiff_t before = sample(*(at - 1));
    while (at != frames.begin() && sample(*(at - 1)) == before) --at;
  }
  std::array<float, kTaxels> held{};
  for (std::ptrdiff_t k = std::max(timesteps - 1, sample(*at)); k >= 0; --k) {
    FrameMean mean;
    for (; at != frames.end() && sample(*at) == k; ++at) mean.add(at->volts);
    if (mean.count() > 0) held = settings_.scaling(mean.volts());
    if (k < timesteps) std::copy(held.begin(), held.end(), out.begin() + (timesteps - 1 - k) * kTaxels);
  }
  if (settings_.scaling.levelled) level(out, kTaxels);
  return true;
}

std::array<float, kTaxels> LiveWindow::newest() const {
  if (filtered_.frames().empty()) return {};
  return settings_.scaling(filtered_.frames().back().volts);
}

}  // namespace supertac
