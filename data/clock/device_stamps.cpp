#include <algorithm>
#include <cmath>

#include "data/clock/clock_model.h"

namespace supertac {

using namespace clock_model;

double finer_unit(double stamp_s, double unit_s) {
  constexpr double kFinestS = 1e-9, kWhole = 1e-3;
  const auto whole = [](double units) { return std::abs(units - std::round(units)) < kWhole; };
  while (unit_s > kFinestS && std::abs(stamp_s) < kMostStampS && !whole(stamp_s / unit_s)) unit_s /= 10;
  return unit_s;
}

double DeviceStamps::step_to(double raw_s, double from_s, double most_s) const {
  const double step = raw_s - from_s, range = settings_.stamp_range_s;
  if (range <= 0) return step;
  if (elapsed_s_ > 0.5 * range) return step + range * std::round((elapsed_s_ - step) / range);
  return step < 0 && step + range <= most_s ? step + range : step;
}

DeviceStamps::Reading DeviceStamps::read(double stamp_s, double elapsed_s, double period_s) {
  if (!settings_.stored)
    elapsed_s_ += elapsed_s, now_s_ += elapsed_s, least_lag_s_ += kClockDrifts * elapsed_s;
  ++since_;
  if (!(std::abs(stamp_s) < kMostStampS)) return {};
  settings_.stamp_unit_s = finer_unit(stamp_s, settings_.stamp_unit_s);
  if (believed_ == 0) return accept(stamp_s, stamp_s, {});
  const double least = settings_.stamp_unit_s > 0.25 * period_s ? 0 : 1e-9;
  // As late as the frames are, so far may a stamp be ahead.
  const double lag_s = now_s_ - last_.time_s - least_lag_s_;
  const double most = std::max({settings_.stored ? kStoredJumpS : lag_s + kOldestS, 10 * period_s});
  const auto goes_on = [&](double step) { return step >= least && step <= most; };
  const double step = step_to(stamp_s, last_.raw_s, most);
  if (goes_on(step)) return accept(stamp_s, last_.time_s + step, {});
  // Where the one before had jumped ahead, and not this one back, it goes on from the one before that.
  const double from_before = step_to(stamp_s, before_.raw_s, most), last_step = last_.time_s - before_.time_s;
  if (believed_ > 1 && !jumped_s_ && goes_on(from_before) &&
      std::abs(from_before - 2 * step_s_) < std::abs(last_step - step_s_))
    return accept(stamp_s, before_.time_s + from_before, {.one_before_damaged = true});
  const double from_jump = jumped_s_ ? step_to(stamp_s, *jumped_s_, most) : -1;
  const bool as_far =
      settings_.stored && from_jump > 0 && std::abs(from_jump - jump_step_s_) < 0.5 * jump_step_s_;
  if (!goes_on(from_jump) && !as_far) {
    jumped_s_ = stamp_s, jump_step_s_ = from_jump;
    return {};
  }
  // Two stamps in a row: the device had paused, or it started anew.
  const bool paused = settings_.stored ? stamp_s > last_.raw_s : step > 0 && step <= most;
  const double since = paused ? step : std::max({elapsed_s_, period_s * since_, from_jump + 1e-3 * period_s});
  last_ = {*jumped_s_, last_.time_s + since - from_jump};
  return accept(stamp_s, last_.time_s + from_jump,
                {.one_before_s = last_.time_s, .reset = !paused && believed_ > 1, .anew = !paused});
}

DeviceStamps::Reading DeviceStamps::accept(double raw_s, double time_s, Reading reading) {
  if (!reading.one_before_damaged) step_s_ = last_.time_s - before_.time_s, before_ = last_;
  last_ = {raw_s, time_s};
  least_lag_s_ = believed_ == 0 || reading.anew ? now_s_ - time_s : std::min(least_lag_s_, now_s_ - time_s);
  jumped_s_.reset();
  jump_step_s_ = elapsed_s_ = since_ = 0;
  ++believed_;
  reading.time_s = time_s;
  return reading;
}

}  // namespace supertac
