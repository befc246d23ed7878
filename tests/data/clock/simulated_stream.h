// Streams of boards with the truth known: what a seed decides is the board, its clock, its cable and its
// host.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "data/clock/frame_clock.h"
#include "io/numbers/random.h"

namespace supertac {

struct StreamTraits {
  double rate_hz = 100, frames = 800;
  double jitter_s = 1e-4;              ///< mean of each frame's delay, which is exponential
  double chunk_s = 0;                  ///< an adapter hands on what it has so often
  double loss_rate = 0, run_rate = 0;  ///< of single frames, and of runs of 2 to 60
  double stall_rate = 0;               ///< per frame: the host stands still for up to 1.5 s
  double capacity = 1e9;               ///< frames that its port holds meanwhile
  double drift = 0;                    ///< of the period from begin to end, a share
  int resets = 0;                      ///< each of up to 2 s without frames
  double stated = 1;                   ///< what the file says, times the true period
  double tolerance = 20;
  double stamp_unit_s = 0, stamp_bits = 32, clock_off = 0;
  bool is_signed = false;
  double damaged_stamps = 0;  ///< a share
};

struct SimulatedStream {
  StreamTraits traits;
  ClockSettings settings;
  std::vector<FrameArrival> arrivals;
  std::vector<double> made_s, device_s;  ///< of each that arrived, on the port's clock and on the device's
  std::vector<int> run;                  ///< of the device: it has started anew so often
  std::uint64_t lost = 0;                ///< between the first and the last that arrived
  double least_delay_s = 1e9;
};

/// A share of the streams each: `unlike` 0 to 1.
inline StreamTraits traits_of(std::uint64_t seed) {
  const RandomStream random(seed, 1);
  std::uint64_t n = 0;
  const auto draw = [&] { return random.uniform(n++); };
  const auto one_of = [&](double share) { return draw() < share; };
  StreamTraits t;
  const bool board = one_of(0.2);
  t.rate_hz = board ? 1 / rig::kFramePeriodS : std::pow(10, 5 * draw());
  t.frames = 300 + std::floor(900 * draw());
  t.jitter_s = std::pow(10, -5 + 3 * draw());
  if (one_of(0.4)) t.chunk_s = 0.001 + 0.5 * std::pow(draw(), 2);
  if (one_of(0.3)) t.loss_rate = std::pow(10, -3 + 1.7 * draw());
  if (one_of(0.3)) t.run_rate = 0.003;
  if (one_of(0.3)) t.stall_rate = 0.002;
  if (one_of(0.3)) t.capacity = 10 + std::floor(200 * draw());
  t.drift = 1e-4 * (draw() - 0.5);
  if (one_of(0.2)) t.resets = 1 + static_cast<int>(2 * draw());
  if (!board && one_of(0.4)) {
    t.stated = std::pow(10, 1.4 * (draw() - 0.5));
    if (std::abs(t.stated - 1) < 0.15) t.stated = 1.5;  // what is nearly right is right
  }
  if (board) t.stated = 1 + 0.006 * (draw() - 0.5), t.tolerance = 0.005;
  if (!board && one_of(0.5)) {
    t.stamp_unit_s = one_of(0.6) ? 1e-3 : 1e-6;
    t.stamp_bits = t.stamp_unit_s == 1e-3 && one_of(0.3) ? 16 : one_of(0.8) ? 32 : 64;
    t.is_signed = one_of(0.3);
    t.clock_off = 0.006 * (draw() - 0.5);
    if (one_of(0.4)) t.damaged_stamps = 0.004;
  }
  return t;
}

inline SimulatedStream simulated(const StreamTraits& t, std::uint64_t seed) {
  const RandomStream random(seed, 2);
  std::uint64_t n = 0;
  const auto draw = [&] { return random.uniform(n++); };
  const auto delay = [&] { return -t.jitter_s * std::log(1 - draw()); };
  SimulatedStream s;
  s.traits = t;
  const double period = 1 / t.rate_hz;
  s.settings = {.period_s = period * t.stated,
                .tolerance = t.tolerance,
                .stamp_unit_s = t.stamp_unit_s,
                .stamp_range_s =
                    t.stamp_unit_s > 0 && t.stamp_bits < 64 ? std::exp2(t.stamp_bits) * t.stamp_unit_s : 0};
  const double range = std::exp2(t.stamp_bits);  // in units
  double time_s = 100 * draw(), device_s = t.stamp_unit_s * (t.stamp_bits < 64 ? range * draw() : 1e9);
  if (t.stamp_bits < 64 && draw() < 0.5) device_s = t.stamp_unit_s * range - period * t.frames * draw();
  double handed_s = 0, taken_s = -1, flush_s = time_s, awake_s = 0, waiting = 0, lose = 0;
  std::uint64_t lost = 0;
  int run = 0;
  for (double i = 0; i < t.frames; ++i) {
    double step = period * (1 + t.drift * i / t.frames);
    if (t.resets > 0 && i > 0 && draw() < t.resets / t.frames) {
      const double silent_s = 0.05 + 2 * draw(), begins_s = 0.3 * draw();
      // A clock that has hardly begun looks as if it went on.
      const double wraps_s = t.stamp_unit_s * range, at_s = std::fmod(device_s, wraps_s);
      if (t.stamp_unit_s == 0 || (at_s > 5 && at_s < wraps_s - 5)) {
        time_s += silent_s, ++run;
        lost += t.stamp_unit_s > 0 ? 0 : static_cast<std::uint64_t>(std::max(1.0, silent_s * t.rate_hz));
        device_s = begins_s;
      }
    }
    time_s += step, device_s += step * (1 + t.clock_off);
    if (draw() < t.run_rate) lose = 2 + std::floor(58 * draw());
    if (lose > 0 || draw() < t.loss_rate) {
      lose -= 1, ++lost;
      continue;
    }
    const double least_s = delay();
    handed_s = std::max(handed_s, time_s + least_s);
    while (t.chunk_s > 0 && flush_s < handed_s) flush_s += t.chunk_s * (0.8 + 0.2 * draw());
    double read_s = t.chunk_s > 0 ? flush_s : handed_s;
    const bool same_read = read_s == taken_s;
    taken_s = read_s;
    if (read_s < awake_s) {
      if (++waiting > t.capacity) {
        ++lost;
        continue;
      }
      read_s = awake_s;
    } else if (!same_read && !s.arrivals.empty() && draw() < t.stall_rate) {
      awake_s = read_s += 0.05 + 1.5 * draw();
      waiting = 1;
    }
    FrameArrival arrival;
    arrival.time_s = read_s;
    if (t.stamp_unit_s > 0) {
      double units = std::floor(device_s / t.stamp_unit_s);
      if (t.stamp_bits < 64) units -= range * std::floor(units / range);
      if (draw() < t.damaged_stamps) {
        const int bit = static_cast<int>(std::min(t.stamp_bits, 50.0) * draw());
        const bool is_set = std::fmod(std::floor(units / std::exp2(bit)), 2) == 1;
        units += is_set ? -std::exp2(bit) : std::exp2(bit);
      }
      if (t.is_signed && t.stamp_bits < 64 && units >= range / 2) units -= range;
      arrival.stamp_s = units * t.stamp_unit_s;
    }
    s.lost += s.arrivals.empty() ? 0 : lost;
    lost = 0;
    s.least_delay_s = std::min(s.least_delay_s, read_s - time_s);
    s.arrivals.push_back(arrival);
    s.made_s.push_back(time_s), s.device_s.push_back(device_s), s.run.push_back(run);
  }
  return s;
}

}  // namespace supertac
