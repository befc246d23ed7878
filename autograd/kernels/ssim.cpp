#include "autograd/kernels/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "autograd/kernels/elementwise.h"
#include "autograd/kernels/fast/sums.h"
#include "autograd/pool.h"

namespace supertac::kernels {
namespace {

constexpr real kC1 = real(0.01 * 0.01), kC2 = real(0.03 * 0.03);  // (K1 L)^2, (K2 L)^2 with range L = 1

struct Window {
  Dim size;
  std::array<real, 11> weight{};
};

// exp(-d^2 / (2 * 1.5^2)) for d = 0 to 5; the last bit of the C library's exp depends on the processor
constexpr double kGaussian[] = {1,
                                0.80073740291680806,
                                0.41111229050718745,
                                0.1353352832366127,
                                0.028565500784550377,
                                0.0038659201394728076};

Window window_for(Dim height, Dim width) {
  const Dim side = std::min(height, width);
  Window w{side >= 11 ? 11 : std::min<Dim>(7, (side - 1) / 2 * 2 + 1)};
  std::array<double, 11> value{};
  double total = 0;
  for (Dim i = 0; i < w.size; ++i) {
    total += value[static_cast<std::size_t>(i)] = w.size < 11 ? 1.0 : kGaussian[std::abs(i - 5)];
  }
  for (std::size_t i = 0; i < value.size(); ++i) w.weight[i] = static_cast<real>(value[i] / total);
  return w;
}

// One image's maps. Moments are taken about the image's own mean: E[x^2] - E[x]^2 of values far from zero
// cancels in fp32 and can turn negative.
class SsimImage {
 public:
  SsimImage(const Window& window, Dim height, Dim width)
      : w_(window),
        h_(height),
        wd_(width),
        oh_(height - window.size + 1),
        ow_(width - window.size + 1),
        store_(static_cast<std::size_t>(kMaps * height * width)) {}

  // The mean over positions; with gx also adds g d ssim / d x.
  double run(const real* x, const real* t, real g, real* gx) {
    real *a = map(0), *b = map(1), *product = map(2), *mean_a = map(3), *mean_b = map(4), *aa = map(5),
         *bb = map(6), *ab = map(7);
    const real ca = centre(x, a), cb = centre(t, b);
    blur(a, mean_a);
    blur(b, mean_b);
    multiply(h_ * wd_, a, a, product);
    blur(product, aa);
    multiply(h_ * wd_, b, b, product);
    blur(product, bb);
    multiply(h_ * wd_, a, b, product);
    blur(product, ab);
    double total = 0;
    const real each = g / static_cast<real>(oh_ * ow_);
    for (Dim i = 0; i < oh_ * ow_; ++i) {
      const real ma = mean_a[i] + ca, mb = mean_b[i] + cb;
      const real va = aa[i] - mean_a[i] * mean_a[i], vb = bb[i] - mean_b[i] * mean_b[i];
      const real cov = ab[i] - mean_a[i] * mean_b[i];
      const real n1 = 2 * ma * mb + kC1, n2 = 2 * cov + kC2;
      const real d1 = ma * ma + mb * mb + kC1, d2 = std::max(va, real(0)) + std::max(vb, real(0)) + kC2;
      const real s = (n1 * n2) / (d1 * d2);
      total += static_cast<double>(s);
      if (gx == nullptr) continue;
      // s as a function of the mean, the variance and the covariance of x
      const real by_mean = 2 * (mb * n2 / (d1 * d2) - ma * s / d1);
      const real by_var = va > 0 ? -s / d2 : 0;
      const real by_cov = 2 * n1 / (d1 * d2);
      aa[i] = each * (by_mean - 2 * mean_a[i] * by_var - mean_b[i] * by_cov);
      bb[i] = each * 2 * by_var;
      ab[i] = each * by_cov;
    }
    if (gx != nullptr) {
      add_transposed_blur(aa, nullptr, gx);
      add_transposed_blur(bb, a, gx);
      add_transposed_blur(ab, b, gx);
    }
    return total / static_cast<double>(oh_ * ow_);
  }

 private:
  static constexpr Dim kMaps = 9;
  real* map(Dim i) { return store_.data() + i * h_ * wd_; }
  real* half() { return map(8); }

  real centre(const real* x, real* to) const {
    const auto mean =
        static_cast<real>(sum_lanes(h_ * wd_, [x](Dim i) { return static_cast<double>(x[i]); }) /
                          static_cast<double>(h_ * wd_));
    for (Dim i = 0; i < h_ * wd_; ++i) to[i] = x[i] - mean;
    return mean;
  }

  // [h, w] -> [oh, ow]: columns first, then rows
  void blur(const real* from, real* __restrict to) {
    real* __restrict columns = half();
    std::fill_n(columns, oh_ * wd_, real(0));
    for (Dim y = 0; y < oh_; ++y) {
      for (Dim k = 0; k < w_.size; ++k) {
        const real weight = w_.weight[static_cast<std::size_t>(k)];
        for (Dim x = 0; x < wd_; ++x) columns[y * wd_ + x] += weight * from[(y + k) * wd_ + x];
      }
    }
    std::fill_n(to, oh_ * ow_, real(0));
    for (Dim y = 0; y < oh_; ++y) {
      for (Dim k = 0; k < w_.size; ++k) {
        const real weight = w_.weight[static_cast<std::size_t>(k)];
        for (Dim x = 0; x < ow_; ++x) to[y * ow_ + x] += weight * columns[y * wd_ + x + k];
      }
    }
  }

  // gx += factor * blur^T(from), factor per pixel (null: 1)
  void add_transposed_blur(const real* from, const real* factor, real* gx) {
    real* __restrict columns = half();
    std::fill_n(columns, oh_ * wd_, real(0));
    for (Dim y = 0; y < oh_; ++y) {
      for (Dim k = 0; k < w_.size; ++k) {
        const real weight = w_.weight[static_cast<std::size_t>(k)];
        for (Dim x = 0; x < ow_; ++x) columns[y * wd_ + x + k] += weight * from[y * ow_ + x];
      }
    }
    for (Dim y = 0; y < oh_; ++y) {
      for (Dim k = 0; k < w_.size; ++k) {
        const real weight = w_.weight[static_cast<std::size_t>(k)];
        const Dim row = (y + k) * wd_;
        for (Dim x = 0; x < wd_; ++x) {
          gx[row + x] += weight * columns[y * wd_ + x] * (factor != nullptr ? factor[row + x] : 1);
        }
      }
    }
  }

  const Window& w_;
  Dim h_, wd_, oh_, ow_;
  Scratch<real> store_;
};

}  // namespace

double ssim(const ImageSizes& s, const real* x, const real* target) {
  const Window window = window_for(s.height, s.width);
  const Dim pixels = s.height * s.width;
  SsimImage image(window, s.height, s.width);
  double total = 0;
  for (Dim n = 0; n < s.images; ++n) total += image.run(x + n * pixels, target + n * pixels, 0, nullptr);
  return total / static_cast<double>(s.images);
}

void ssim_grad(const ImageSizes& s, real g, const real* x, const real* target, real* gx) {
  const Window window = window_for(s.height, s.width);
  const Dim pixels = s.height * s.width;
  const real each = g / static_cast<real>(s.images);
  SsimImage image(window, s.height, s.width);
  for (Dim n = 0; n < s.images; ++n) image.run(x + n * pixels, target + n * pixels, each, gx + n * pixels);
}

}  // namespace supertac::kernels
