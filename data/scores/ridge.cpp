#include "data/scores/ridge.h"

#include <cblas.h>
#include <lapacke.h>
#include <omp.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "data/windows/split.h"

namespace supertac {
namespace {

constexpr std::size_t kSteps = 16, kMostFeatures = 2048;
constexpr std::size_t kHeldOut = 5;  // every so many passes
constexpr double kPenalties[] = {1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 10};

std::size_t steps_of(std::size_t timesteps, std::size_t signals) {
  return std::min({timesteps, kSteps, std::max<std::size_t>(1, kMostFeatures / signals)});
}

std::size_t features_of(std::size_t timesteps, std::size_t signals) {
  return steps_of(timesteps, signals) * signals + 1;
}

// Means over equal stretches of time, then 1.
void fill_features(std::span<const float> window, std::size_t signals, std::span<double> out) {
  const std::size_t frames = window.size() / signals, steps = steps_of(frames, signals);
  std::fill(out.begin(), out.end(), 0.0);
  for (std::size_t s = 0; s < steps; ++s) {
    const std::size_t begin = s * frames / steps, end = (s + 1) * frames / steps;
    for (std::size_t t = begin; t < end; ++t) {
      for (std::size_t k = 0; k < signals; ++k)
        out[s * signals + k] += window[t * signals + k] / static_cast<double>(end - begin);
    }
  }
  out.back() = 1;
}

// Keeps OpenBLAS to one thread while it lives, so that sums have one order; a build of OpenBLAS with OpenMP
// takes and changes OpenMP's number of threads.
class OneThread {
 public:
  OneThread() { openblas_set_num_threads(1); }
  ~OneThread() {
    openblas_set_num_threads(before_);
    omp_set_num_threads(openmp_before_);
  }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_ = openblas_get_num_threads(), openmp_before_ = omp_get_max_threads();
};

// What least squares needs of a set of windows: X'X (its upper triangle), X'Y and Y'Y; all matrices are
// row-major.
struct Moments {
  int features, pixels;
  std::vector<double> xx, xy;
  double yy = 0;

  Moments(const WindowSet& windows, std::span<const std::uint32_t> indices)
      : features(static_cast<int>(
            features_of(static_cast<std::size_t>(windows.timesteps()), windows.array().signals()))),
        pixels(static_cast<int>(windows.image().pixels())),
        xx(static_cast<std::size_t>(features) * static_cast<std::size_t>(features)),
        xy(static_cast<std::size_t>(features) * static_cast<std::size_t>(pixels)) {
    constexpr std::size_t kBlock = 512;
    for (std::size_t first = 0; first < indices.size(); first += kBlock)
      add(windows, indices.subspan(first, std::min(kBlock, indices.size() - first)));
  }

  void add(const WindowSet& windows, std::span<const std::uint32_t> part) {
    const auto f = static_cast<std::size_t>(features), p = static_cast<std::size_t>(pixels);
    std::vector<double> x(part.size() * f), y;
    std::vector<float> truth(p);
    std::vector<float> window(static_cast<std::size_t>(windows.timesteps()) * windows.array().signals());
    for (std::size_t n = 0; n < part.size(); ++n) {
      windows.window(part[n], window);
      fill_features(window, windows.array().signals(), std::span(x).subspan(n * f, f));
      windows.truth(part[n], truth);
      y.insert(y.end(), truth.begin(), truth.end());
    }
    const int n = static_cast<int>(part.size());
    cblas_dsyrk(CblasRowMajor, CblasUpper, CblasTrans, features, n, 1, x.data(), features, 1, xx.data(),
                features);
    cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, features, pixels, n, 1, x.data(), features, y.data(),
                pixels, 1, xy.data(), pixels);
    yy += dot(y, y);
  }

  Moments& operator+=(const Moments& other) {
    std::transform(xx.begin(), xx.end(), other.xx.begin(), xx.begin(), std::plus());
    std::transform(xy.begin(), xy.end(), other.xy.begin(), xy.begin(), std::plus());
    yy += other.yy;
    return *this;
  }

  // W [f][pixels]
  std::vector<double> solve(double penalty) const {
    const auto n = static_cast<std::size_t>(features);
    double mean = 0;
    for (std::size_t i = 0; i + 1 < n; ++i) mean += xx[i * (n + 1)] / static_cast<double>(n - 1);
    std::vector<double> a = xx, w = xy;
    // Taxels that never move leave rows of zeros; the floor keeps the matrix positive definite.
    for (std::size_t i = 0; i + 1 < n; ++i) a[i * (n + 1)] += penalty * mean + 1e-9;
    if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'U', features, pixels, a.data(), features, w.data(), pixels) != 0)
      throw std::runtime_error("ridge: X'X of the windows is not positive definite");
    return w;
  }

  // |Y - X W|^2
  double error(const std::vector<double>& w) const {
    std::vector<double> product(w.size());
    cblas_dsymm(CblasRowMajor, CblasLeft, CblasUpper, features, pixels, 1, xx.data(), features, w.data(),
                pixels, 0, product.data(), pixels);
    return yy - 2 * dot(w, xy) + dot(w, product);
  }

  static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    return cblas_ddot(static_cast<int>(a.size()), a.data(), 1, b.data(), 1);
  }
};

// Which windows judge the penalty: whole passes, since neighbours of one pass are nearly the same.
std::vector<bool> held_out(const WindowSet& windows, std::span<const std::uint32_t> indices) {
  std::vector<std::size_t> passes;
  for (const std::uint32_t i : indices) {
    if (passes.empty() || passes.back() != windows.pass_of(i)) passes.push_back(windows.pass_of(i));
  }
  std::vector<bool> held(indices.size());
  for (std::size_t n = 0; n < indices.size(); ++n) {
    const auto at = std::find(passes.begin(), passes.end(), windows.pass_of(indices[n])) - passes.begin();
    held[n] = passes.size() == 1
                  ? n >= indices.size() - indices.size() / kHeldOut
                  : static_cast<std::size_t>(at) % kHeldOut == std::min(kHeldOut, passes.size()) - 1;
  }
  return held;
}

}  // namespace

Ridge::Ridge(const WindowSet& windows, std::span<const std::uint32_t> train)
    : timesteps_(static_cast<std::size_t>(windows.timesteps())),
      signals_(windows.array().signals()),
      pixels_(windows.image().pixels()) {
  if (train.empty()) throw std::invalid_argument("ridge: there is no window to fit to");
  const std::vector<std::uint32_t> chosen = spread(train, kFitWindows);
  const std::vector<bool> held = held_out(windows, chosen);
  std::vector<std::uint32_t> fit, judge;
  for (std::size_t n = 0; n < chosen.size(); ++n) (held[n] ? judge : fit).push_back(chosen[n]);
  const OneThread one_thread;
  Moments moments(windows, fit);
  const Moments other(windows, judge);
  double least = 0;
  for (const double penalty : kPenalties) {
    const double error = other.error(moments.solve(penalty));
    if (penalty_ == 0 || error < least) {
      penalty_ = penalty;
      least = error;
    }
  }
  const std::vector<double> w = (moments += other).solve(penalty_);
  weights_.assign(w.begin(), w.end());
}

void Ridge::predict(std::span<const float> window, std::span<float> out) const {
  if (window.size() != timesteps_ * signals_ || out.size() != pixels_) {
    throw std::invalid_argument("ridge: expects a window [" + std::to_string(timesteps_) + "][" +
                                std::to_string(signals_) + "] and " + std::to_string(pixels_) +
                                " pixels, got " + std::to_string(window.size()) + " and " +
                                std::to_string(out.size()) + " values");
  }
  std::vector<double> used(features_of(timesteps_, signals_));
  fill_features(window, signals_, used);
  std::fill(out.begin(), out.end(), 0.0f);
  for (std::size_t f = 0; f < used.size(); ++f) {
    const float* row = weights_.data() + f * pixels_;
    for (std::size_t p = 0; p < pixels_; ++p) out[p] += static_cast<float>(used[f]) * row[p];
  }
}

}  // namespace supertac
