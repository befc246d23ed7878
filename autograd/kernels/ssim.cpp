// Structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004) and its gradient.
#include <algorithm>
#include <array>
#include <cmath>

#include "autograd/kernels/losses.h"

namespace supertac::kernels {
namespace {

constexpr real kC1 = real(0.01 * 0.01), kC2 = real(0.03 * 0.03);  // (K1 L)^2, (K2 L)^2 with range L = 1

struct Window {
  Dim size;
  std::array<real, 11> weight{};
};

// exp(-d^2 / (2 * 1.5^2)) for d = 0 to 5; the last bit of the C library's exp depends on the processor
constexpr double kGaussian[] = {1,
                                0.8007374029168081,
                                0.41111229050718745,
                                0.1353352832366127,
                                0.028565500784550377,
                                0.0038659201394728076};

Window window_for(Dim height, Dim width) {
  const Dim side = std::min(height, width);
  Window w{side >= 11 ? 11 : std::min<Dim>(7, (side - 1) / 2 * 2 + 1)};
  std::array<double, 11> value{};
  double total = 0;
  for (Dim i = 0; i < w.size; ++i)
    total += value[static_cast<std::size_t>(i)] = w.size < 11 ? 1.0 : kGaussian[std::abs(i - 5)];
  for (std::size_t i = 0; i < value.size(); ++i) w.weight[i] = static_cast<real>(value[i] / total);
  return w;
}

// Windowed moments of one image and what is made of them. They are taken about the image's own mean: E[x^2] -
// E[x]^2 of values far from zero cancels in fp32 and can turn negative.
class SsimImage {
 public:
  SsimImage(Dim height, Dim width)
      : w_(window_for(height, width)),
        h_(height),
        wd_(width),
        oh_(height - w_.size + 1),
        ow_(width - w_.size + 1),
        store_(Shape{kMaps * height * width}) {}

  // The mean over positions.
  double value(const real* x, const real* target) {
    take_moments(x, target);
    double total = 0;
    for (Dim i = 0; i < oh_ * ow_; ++i) total += static_cast<double>(terms_at(i).value());
    return total / static_cast<double>(oh_ * ow_);
  }

  // S = n1 n2 / (d1 d2) of a position depends on x by its windowed mean m, variance v and covariance c:
  //   dS/dm = 2 (mean_b n2 / (d1 d2) - mean_a S / d1),  dS/dv = -S / d2,  dS/dc = 2 n1 / (d1 d2)
  // and with blur the windowed sum, m = blur(x), v = blur(x^2) - m^2, c = blur(x target) - m blur(target):
  //   gx += blur^T(by_x) + x blur^T(by_square) + target blur^T(by_product)
  // x, target, gx [h,w]; S, m, v, c and by_* [oh,ow]; blur^T [oh,ow] -> [h,w]
  void add_gradient(const real* x, const real* target, real g, real* gx) {
    take_moments(x, target);
    const real share = g / static_cast<real>(oh_ * ow_);
    for (Dim i = 0; i < oh_ * ow_; ++i) {
      const Terms t = terms_at(i);
      const real s = t.value();
      const real by_mean = 2 * (t.mean_b * t.n2 / (t.d1 * t.d2) - t.mean_a * s / t.d1);
      const real by_var = t.var_a > 0 ? -s / t.d2 : 0;
      const real by_cov = 2 * t.n1 / (t.d1 * t.d2);
      by_x_[i] = share * (by_mean - 2 * mean_a_[i] * by_var - mean_b_[i] * by_cov);
      by_square_[i] = share * 2 * by_var;
      by_product_[i] = share * by_cov;
    }
    add_transposed_blur(by_x_, nullptr, gx);
    add_transposed_blur(by_square_, a_, gx);
    add_transposed_blur(by_product_, b_, gx);
  }

 private:
  static constexpr Dim kMaps = 12;  // those at the end of the class
  real* map(Dim i) { return store_.data() + i * h_ * wd_; }

  // Wang et al. 2004, eq. 13, at one position of the window: n1 n2 / (d1 d2).
  struct Terms {
    real mean_a, mean_b, var_a, n1, n2, d1, d2;
    real value() const { return (n1 * n2) / (d1 * d2); }
  };
  Terms terms_at(Dim i) const {
    const real ma = mean_a_[i] + centre_a_, mb = mean_b_[i] + centre_b_;
    const real va = aa_[i] - mean_a_[i] * mean_a_[i], vb = bb_[i] - mean_b_[i] * mean_b_[i];
    const real cov = ab_[i] - mean_a_[i] * mean_b_[i];
    const real n1 = 2 * ma * mb + kC1, n2 = 2 * cov + kC2;
    const real d1 = ma * ma + mb * mb + kC1, d2 = std::max(va, real(0)) + std::max(vb, real(0)) + kC2;
    return {ma, mb, va, n1, n2, d1, d2};
  }

  // x, target [h,w] -> their centred images [h,w], and windowed means, squares and product [oh,ow]
  void take_moments(const real* x, const real* target) {
    centre_a_ = centre(x, a_);
    centre_b_ = centre(target, b_);
    blur(a_, mean_a_);
    blur(b_, mean_b_);
    blur_product(a_, a_, aa_);
    blur_product(b_, b_, bb_);
    blur_product(a_, b_, ab_);
  }

  // to = x - its mean, [h,w]; returns the mean
  real centre(const real* x, real* to) const {
    const auto mean =
        static_cast<real>(sum_of(h_ * wd_, [x](Dim i) { return x[i]; }) / static_cast<double>(h_ * wd_));
    for (Dim i = 0; i < h_ * wd_; ++i) to[i] = x[i] - mean;
    return mean;
  }

  // to [oh,ow] = blur(a b), a, b [h,w]
  void blur_product(const real* a, const real* b, real* to) {
    for (Dim i = 0; i < h_ * wd_; ++i) product_[i] = a[i] * b[i];
    blur(product_, to);
  }

  // [h, w] -> [oh, ow]: columns first, then rows
  void blur(const real* from, real* to) {
    std::fill_n(columns_, oh_ * wd_, real(0));
    add_windows(wd_, from, {wd_, wd_}, nullptr, columns_, {wd_, 0});
    std::fill_n(to, oh_ * ow_, real(0));
    add_windows(ow_, columns_, {wd_, 1}, nullptr, to, {ow_, 0});
  }

  // gx += factor * blur^T(from), factor per pixel (null: 1)
  void add_transposed_blur(const real* from, const real* factor, real* gx) {
    std::fill_n(columns_, oh_ * wd_, real(0));
    add_windows(ow_, from, {ow_, 0}, nullptr, columns_, {wd_, 1});
    add_windows(wd_, columns_, {wd_, 0}, factor, gx, {wd_, wd_});
  }

  // to[y, k, x] += weight[k] from[y, k, x] factor[y, k, x] for y < oh, the k of the window and x < width,
  // each at y line + k step + x of its array; factor's are those of `to`
  struct Walk {
    Dim line, step;
  };
  void add_windows(Dim width, const real* from, Walk f, const real* factor, real* __restrict to, Walk t) {
    for (Dim y = 0; y < oh_; ++y) {
      for (Dim k = 0; k < w_.size; ++k) {
        const real weight = w_.weight[static_cast<std::size_t>(k)];
        const real* at = from + y * f.line + k * f.step;
        const Dim first = y * t.line + k * t.step;
        if (factor == nullptr) {
          for (Dim x = 0; x < width; ++x) to[first + x] += weight * at[x];
        } else {
          for (Dim x = 0; x < width; ++x) to[first + x] += weight * at[x] * factor[first + x];
        }
      }
    }
  }

  Window w_;
  Dim h_, wd_, oh_, ow_;
  Tensor store_;
  real *const a_ = map(0), *const b_ = map(1);  // [h,w]: the two images less their means
  real centre_a_ = 0, centre_b_ = 0;
  real *const mean_a_ = map(2), *const mean_b_ = map(3), *const aa_ = map(4), *const bb_ = map(5),
              *const ab_ = map(6);  // [oh,ow]: windowed, of a, b, a a, b b and a b
  real *const by_x_ = map(7), *const by_square_ = map(8), *const by_product_ = map(9);  // [oh,ow]: gradients
  real* const product_ = map(10);                                                       // [h,w]
  real* const columns_ = map(11);  // [oh,w]: blurred along the columns, not yet along the rows
};

}  // namespace

// x, target [n,h,w]
double ssim(Dim images, Dim height, Dim width, const real* x, const real* target) {
  SsimImage image(height, width);
  double total = 0;
  for (Dim n = 0, at = 0; n < images; ++n, at += height * width) total += image.value(x + at, target + at);
  return total;
}
void ssim_grad(Dim images, Dim height, Dim width, real g, const real* x, const real* target, Slot gx) {
  if (!gx) return;
  gx.begin(images * height * width);
  SsimImage image(height, width);
  for (Dim n = 0, at = 0; n < images; ++n, at += height * width)
    image.add_gradient(x + at, target + at, g, gx.data + at);
}

}  // namespace supertac::kernels
