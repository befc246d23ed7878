#include "bench/studies/corruption.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "data/sensors/rig.h"
#include "io/numbers/random.h"

namespace supertac {
namespace {

constexpr std::size_t kSignals = rig::kTaxels;
constexpr std::uint64_t kSeed = 0x636f7272;

RandomStream random_of(std::uint64_t draw) { return {kSeed, draw}; }
float clipped(double x) { return static_cast<float>(std::clamp(x, 0.0, 1.0)); }

// Different taxels in an order that depends on the window alone.
std::array<std::size_t, kSignals> order_of_taxels(std::uint64_t draw) {
  std::array<std::size_t, kSignals> order;
  for (std::size_t k = 0; k < kSignals; ++k) order[k] = k;
  const RandomStream random = random_of(draw);
  for (std::size_t i = 0; i + 1 < kSignals; ++i)
    std::swap(order[i],
              order[i + static_cast<std::size_t>(random.uniform(i) * static_cast<double>(kSignals - i))]);
  return order;
}

// x[t,k] <- f(x, t as a share of the window, k)
template <class F>
void each(std::span<float> window, F f) {
  const std::size_t frames = window.size() / kSignals;
  for (std::size_t t = 0; t < frames; ++t)
    for (std::size_t k = 0; k < kSignals; ++k) {
      float& x = window[t * kSignals + k];
      x = clipped(f(double{x}, static_cast<double>(t) / static_cast<double>(frames), k));
    }
}

// The window as it was at source(t), in frames; between two it is linear, before the first it stands.
template <class F>
void in_other_time(std::span<float> window, F source) {
  const std::vector<float> before(window.begin(), window.end());
  const std::size_t frames = window.size() / kSignals;
  for (std::size_t t = 0; t < frames; ++t) {
    const double at = std::clamp(source(t), 0.0, static_cast<double>(frames - 1));
    const auto from = std::min(static_cast<std::size_t>(at), frames - 2);
    const auto part = static_cast<float>(at - static_cast<double>(from));
    for (std::size_t k = 0; k < kSignals; ++k)
      window[t * kSignals + k] =
          std::lerp(before[from * kSignals + k], before[(from + 1) * kSignals + k], part);
  }
}

void noise(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = clipped(w[i] + s * random.normal(i));
}
void drift(double s, std::uint64_t draw, std::span<float> w) {
  const std::size_t taxel = order_of_taxels(draw)[0];
  each(w, [=](double x, double t, std::size_t k) { return k == taxel ? x + s * t : x; });
}
void gain(double s, std::uint64_t draw, std::span<float> w) {
  const double from = 0.25 + 0.5 * random_of(draw).uniform(99);
  each(w, [=](double x, double t, std::size_t) { return t < from ? x : x * (1 - s); });
}
void stuck(double s, std::uint64_t draw, std::span<float> w) {
  const auto order = order_of_taxels(draw);
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i) {
    const auto value = static_cast<float>(random_of(draw).uniform(50 + i));
    for (std::size_t at = order[i]; at < w.size(); at += kSignals) w[at] = value;
  }
}
void dead(double s, std::uint64_t draw, std::span<float> w) {
  const auto order = order_of_taxels(draw);
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i)
    for (std::size_t at = order[i]; at < w.size(); at += kSignals) w[at] = 0;
}
void saturated(double s, std::uint64_t, std::span<float> w) {
  for (float& x : w) x = std::min(x, static_cast<float>(s));
}
void jitter(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  in_other_time(w, [&](std::size_t t) { return static_cast<double>(t) + s * random.normal(t); });
}
void lost(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  for (std::size_t t = 1; t < w.size() / kSignals; ++t)
    if (random.uniform(t) < s) std::copy_n(&w[(t - 1) * kSignals], kSignals, &w[t * kSignals]);
}
// The finger was slower than stated: the window shows a shorter way.
void speed(double s, std::uint64_t, std::span<float> w) {
  const auto last = static_cast<double>(w.size() / kSignals - 1);
  in_other_time(w, [=](std::size_t t) { return last - (last - static_cast<double>(t)) * (1 - s); });
}
void tilt(double s, std::uint64_t, std::span<float> w) {
  constexpr double kMiddle = (rig::kTaxelRows - 1) / 2.0;
  each(w, [=](double x, double, std::size_t k) {
    return x * (1 + s * (static_cast<double>(k / rig::kTaxelColumns) - kMiddle) / kMiddle);
  });
}
// So many pairs of rows have their cables exchanged.
void swapped(double s, std::uint64_t draw, std::span<float> w) {
  const RandomStream random = random_of(draw);
  std::array<std::size_t, kSignals> from;
  for (std::size_t k = 0; k < kSignals; ++k) from[k] = k;
  for (std::size_t i = 0; i < static_cast<std::size_t>(s); ++i) {
    const auto row = static_cast<std::size_t>(random.uniform(i) * (rig::kTaxelRows - 1));
    std::swap_ranges(&from[row * rig::kTaxelColumns], &from[(row + 1) * rig::kTaxelColumns],
                     &from[(row + 1) * rig::kTaxelColumns]);
  }
  for (std::size_t t = 0; t < w.size() / kSignals; ++t) {
    std::array<float, kSignals> frame;
    std::copy_n(&w[t * kSignals], kSignals, frame.begin());
    for (std::size_t k = 0; k < kSignals; ++k) w[t * kSignals + k] = frame[from[k]];
  }
}
// A pad that keeps a share s of its dent for a second (at 100 frames a second), and lets go later than it
// gives way.
void creep(double s, std::uint64_t, std::span<float> w) {
  constexpr double kDecay = 0.99;
  std::array<double, kSignals> dent{};
  each(w, [&](double x, double, std::size_t k) {
    dent[k] = std::max(x, kDecay * dent[k]);
    return (1 - s) * x + s * dent[k];
  });
}

}  // namespace

const std::vector<Corruption>& corruptions() {
  static const std::vector<Corruption> kAll = {
      {"noise", "standard deviation, share of the range", {0.01, 0.02, 0.04, 0.08, 0.16}, noise},
      {"drift", "of one taxel within the window, share of the range", {0.02, 0.05, 0.1, 0.2, 0.4}, drift},
      {"gain", "lost in mid-pass, share", {0.05, 0.1, 0.2, 0.3, 0.5}, gain},
      {"stuck", "taxels that show one value", {1, 2, 3, 4, 6}, stuck},
      {"dead", "taxels that show rest", {1, 2, 3, 4, 6}, dead},
      {"saturated", "at this share of the range", {0.8, 0.6, 0.4, 0.3, 0.2}, saturated},
      {"jitter", "of a sample's time, samples", {0.5, 1, 2, 4, 8}, jitter},
      {"lost", "frames, share; each repeats the last", {0.1, 0.2, 0.3, 0.5, 0.7}, lost},
      {"speed", "slower than stated, share", {0.02, 0.05, 0.1, 0.2, 0.3}, speed},
      {"tilt", "outer rows' gain, share", {0.1, 0.2, 0.3, 0.5, 0.7}, tilt},
      {"swapped", "neighbouring rows exchanged, times", {1, 2, 3, 4, 5}, swapped},
      {"creep", "of the dent that stays, share", {0.05, 0.1, 0.2, 0.3, 0.5}, creep}};
  return kAll;
}

}  // namespace supertac
