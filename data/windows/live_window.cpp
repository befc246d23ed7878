#include "data/windows/live_window.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "data/windows/transforms/normalise_window.h"

namespace supertac {
namespace {

// How far before the newest frame a window may end.
constexpr double kLookBackS = 0.1;

void check(const LiveWindowSettings& s) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument("live window: " + what); };
  if (s.signals < 1) fail("a frame must have at least 1 signal");
  if (s.timesteps < 1) fail("timesteps must be at least 1, got " + std::to_string(s.timesteps));
  if (!(s.rate_hz > 0) || !(s.frame_period_s > 0) || !(s.max_gap_s > 0) ||
      !(std::abs(s.scaling.span_volts) > 0))
    fail("rate_hz, frame_period_s and max_gap_s must be positive, span_volts not 0, got " +
         std::to_string(s.rate_hz) + ", " + std::to_string(s.frame_period_s) + ", " +
         std::to_string(s.max_gap_s) + " and " + std::to_string(s.scaling.span_volts));
  if (!(s.filter_s >= 0)) fail("filter_s must not be negative, got " + std::to_string(s.filter_s));
}

double window_s(const LiveWindowSettings& s) { return s.timesteps / s.rate_hz; }

LiveWindowSettings checked(LiveWindowSettings s) {
  check(s);
  s.max_gap_s = std::max(s.max_gap_s, kGapPeriods * s.frame_period_s);
  s.rate_hz = sample_rate_hz(s.timesteps, s.rate_hz, s.frame_period_s);
  return s;
}

}  // namespace

void LiveWindow::Recent::push(double time_s, std::span<const float> volts) {
  times_.push_back(time_s);
  volts_.insert(volts_.end(), volts.begin(), volts.end());
  while (times_[first_] < time_s - span_s_) ++first_;
  if (2 * first_ < times_.size()) return;
  times_.erase(times_.begin(), times_.begin() + static_cast<std::ptrdiff_t>(first_));
  volts_.erase(volts_.begin(), volts_.begin() + static_cast<std::ptrdiff_t>(first_ * signals_));
  first_ = 0;
}

void LiveWindow::Recent::clear() {
  times_.clear();
  volts_.clear();
  first_ = 0;
}

// A sample without frames repeats an older one, whose frames may lie a gap and a period before the window.
LiveWindow::LiveWindow(const LiveWindowSettings& settings)
    : settings_(checked(settings)),
      raw_(std::max(0.0, settings.filter_s - 0.5 * settings.frame_period_s), settings.signals),
      filtered_(window_s(settings_) + settings_.max_gap_s + 2 / settings_.rate_hz + kLookBackS,
                settings.signals),
      mean_(settings.signals),
      average_(settings.signals) {}

void LiveWindow::push(double time_s, std::span<const float> volts) {
  if (volts.size() != settings_.signals)
    throw std::invalid_argument("live window: a frame has " + std::to_string(settings_.signals) +
                                " signals, got " + std::to_string(volts.size()));
  if (!std::isfinite(time_s) ||
      !std::all_of(volts.begin(), volts.end(), [](float v) { return std::isfinite(v); })) {
    ++counters_.damaged;
    return;
  }
  const bool is_first = filtered_.count() == 0;
  if (is_first || std::abs(time_s - filtered_.newest_s()) > settings_.max_gap_s) {
    if (!is_first) ++counters_.gaps;
    raw_.clear();
    filtered_.clear();
    run_begin_s_ = time_s;
  } else if (time_s <= filtered_.newest_s()) {
    ++counters_.late;
    return;
  }
  ++counters_.frames;
  if (settings_.filter_s > 0) {
    raw_.push(time_s, volts);
    mean_.clear();
    for (std::size_t i = 0; i < raw_.count(); ++i) mean_.add(raw_.volts(i));
    mean_.volts(average_);
    volts = average_;
  }
  filtered_.push(time_s, volts);
}

double LiveWindow::end_s() const {
  if (filtered_.count() == 0) return 0;
  return filtered_.newest_s() + 0.5 * std::min(settings_.frame_period_s, 1 / settings_.rate_hz);
}

bool LiveWindow::window_until(double end_s, std::span<float> out) {
  const auto timesteps = static_cast<std::ptrdiff_t>(settings_.timesteps);
  const std::size_t signals = settings_.signals, values = static_cast<std::size_t>(timesteps) * signals;
  if (out.size() != values)
    throw std::invalid_argument("live window: needs room for " + std::to_string(values) + " values, got " +
                                std::to_string(out.size()));
  const std::size_t frames = filtered_.count();
  const double since_begin = (end_s - run_begin_s_) * settings_.rate_hz;
  if (frames == 0 || since_begin < static_cast<double>(timesteps) - 0.5 - kCellSlack) return false;

  // Sample k, counted back from the window's end, that a frame belongs to; negative: later than the window.
  const auto sample = [&](std::size_t frame) {
    const double periods = (end_s - filtered_.time_s(frame)) * settings_.rate_hz;
    return static_cast<std::ptrdiff_t>(std::floor(periods + kCellSlack));
  };
  std::size_t at = 0;  // the first frame that is not older than the window
  for (std::size_t end = frames; at < end;) {
    const std::size_t middle = at + (end - at) / 2;
    if (sample(middle) >= timesteps)
      at = middle + 1;
    else
      end = middle;
  }
  if (at != 0 && (at == frames || sample(at) < timesteps - 1)) {
    // The oldest sample has no frames: it repeats the last one before the window.
    const std::ptrdiff_t before = sample(at - 1);
    while (at != 0 && sample(at - 1) == before) --at;
  }
  std::vector<float>& held = average_;  // push() needs neither between two frames
  std::fill(held.begin(), held.end(), 0.0F);
  for (std::ptrdiff_t k = std::max(timesteps - 1, sample(at)); k >= 0; --k) {
    mean_.clear();
    for (; at != frames && sample(at) == k; ++at) mean_.add(filtered_.volts(at));
    if (mean_.count() > 0) {
      mean_.volts(held);
      settings_.scaling(held);
    }
    if (k >= timesteps) continue;
    std::copy(held.begin(), held.end(),
              out.begin() + (timesteps - 1 - k) * static_cast<std::ptrdiff_t>(signals));
  }
  if (settings_.scaling.per_window) normalise_window(out, settings_.signals);
  return true;
}

}  // namespace supertac
