#include "lessons.h"

namespace lessons {
namespace {

constexpr std::size_t kWindow = 7;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03, kShare = 1.0 / (kWindow * kWindow);

struct Moments {
  double mx = 0, my = 0, xx = 0, yy = 0, xy = 0;  // means, variances, covariance in one window
};

Moments moments_at(std::size_t side, const Array& x, const Array& y, std::size_t row, std::size_t column) {
  Moments m;
  const auto each = [&](auto f) {
    for (std::size_t i = 0; i < kWindow * kWindow; ++i) f((row + i / kWindow) * side + column + i % kWindow);
  };
  each([&](std::size_t p) { m.mx += kShare * x[p], m.my += kShare * y[p]; });
  each([&](std::size_t p) {
    m.xx += kShare * (x[p] - m.mx) * (x[p] - m.mx);
    m.yy += kShare * (y[p] - m.my) * (y[p] - m.my);
    m.xy += kShare * (x[p] - m.mx) * (y[p] - m.my);
  });
  return m;
}

}  // namespace

double ssim(std::size_t side, const Array& x, const Array& truth) {
  const std::size_t places = side - kWindow + 1;
  double sum = 0;
  for (std::size_t at = 0; at < places * places; ++at) {
    const Moments m = moments_at(side, x, truth, at / places, at % places);
    sum += (2 * m.mx * m.my + kC1) * (2 * m.xy + kC2) /
           ((m.mx * m.mx + m.my * m.my + kC1) * (m.xx + m.yy + kC2));
  }
  return sum / static_cast<double>(places * places);
}

void ssim_gradient(std::size_t side, const Array& x, const Array& truth, double g, Array& gx) {
  const std::size_t places = side - kWindow + 1;
  for (std::size_t at = 0; at < places * places; ++at) {
    const std::size_t row = at / places, column = at % places;
    const Moments m = moments_at(side, x, truth, row, column);
    const double n1 = 2 * m.mx * m.my + kC1, n2 = 2 * m.xy + kC2;
    const double d1 = m.mx * m.mx + m.my * m.my + kC1, d2 = m.xx + m.yy + kC2, s = n1 * n2 / (d1 * d2);
    const double by_mean = 2 * m.my * n2 / (d1 * d2) - 2 * m.mx * s / d1;
    const double by_variance = -s / d2, by_covariance = 2 * n1 / (d1 * d2);
    for (std::size_t i = 0; i < kWindow * kWindow; ++i) {
      const std::size_t p = (row + i / kWindow) * side + column + i % kWindow;
      gx[p] += g * kShare / static_cast<double>(places * places) *
               (by_mean + by_variance * 2 * (x[p] - m.mx) + by_covariance * (truth[p] - m.my));
    }
  }
}

}  // namespace lessons
