#include "data/scores/baselines.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>

#include "data/windows/split.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

std::vector<std::uint32_t> fitted_on(std::span<const std::uint32_t> train) {
  if (train.empty()) throw std::invalid_argument(refusal("baseline", "train", "a window or more", "none"));
  return evenly_spaced(train, kFitWindows);
}

void check_input(std::span<const float> input, const TaxelArray& array) {
  if (input.empty() || input.size() % array.signals() != 0)
    throw std::invalid_argument(refusal("baseline", "window", "[T][" + std::to_string(array.signals()) + "]",
                                        std::to_string(input.size()) + " values"));
}

double keys_kernel(double distance) {
  constexpr double a = -0.5;
  const double d = std::abs(distance);
  if (d < 1) return ((a + 2) * d - (a + 3)) * d * d + 1;
  if (d < 2) return ((a * d - 5 * a) * d + 8 * a) * d - 4 * a;
  return 0;
}

// Of the taxels of a line on its pixels, [pixels][taxels].
std::vector<float> weights_of(int taxels, int scale) {
  std::vector<float> weights(static_cast<std::size_t>(taxels) * static_cast<std::size_t>(taxels) *
                             static_cast<std::size_t>(scale));
  for (int p = 0; p < taxels * scale; ++p) {
    const double u = (p + 0.5) / scale - 0.5;
    const int left = static_cast<int>(std::floor(u));
    float* row = &weights[static_cast<std::size_t>(p) * static_cast<std::size_t>(taxels)];
    const auto inside = [&](int taxel) { return static_cast<std::size_t>(std::clamp(taxel, 0, taxels - 1)); };
    for (int taxel = left - 1; taxel <= left + 2; ++taxel)
      row[inside(taxel)] += static_cast<float>(keys_kernel(u - taxel));
  }
  return weights;
}

}  // namespace

Baseline mean_image(const WindowSet& windows, std::span<const std::uint32_t> train) {
  std::vector<float> truth(windows.image().pixels()), image;
  std::vector<double> sum(truth.size());
  const std::vector<std::uint32_t> chosen = fitted_on(train);
  for (const std::uint32_t i : chosen) {
    windows.truth(i, truth);
    for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += truth[p];
  }
  for (const double s : sum) image.push_back(static_cast<float>(s / static_cast<double>(chosen.size())));
  return {"mean_image", [array = windows.array(), image](auto input, auto out) {
            check_input(input, array);
            expect_values("baseline", "image", image.size(), out.size());
            std::ranges::copy(image, out.begin());
          }};
}

std::function<void(std::span<const float>, std::span<float>)> bicubic_enlargement(int rows, int columns,
                                                                                  int scale) {
  const auto height = static_cast<std::size_t>(rows), width = static_cast<std::size_t>(columns);
  return [=, down = weights_of(rows, scale), across = weights_of(columns, scale)](auto frame, auto out) {
    const std::size_t down_pixels = down.size() / height, across_pixels = across.size() / width;
    expect_values("baseline", "frame", height * width, frame.size());
    expect_values("baseline", "image", down_pixels * across_pixels, out.size());
    std::vector<float> row(width);  // the frame's columns at this row of the image
    for (std::size_t r = 0; r < down_pixels; ++r) {
      std::fill(row.begin(), row.end(), 0.0F);
      for (std::size_t k = 0; k < frame.size(); ++k)
        row[k % width] += down[r * height + k / width] * frame[k];
      for (std::size_t c = 0; c < across_pixels; ++c) {
        float value = 0;
        for (std::size_t k = 0; k < width; ++k) value += across[c * width + k] * row[k];
        out[r * across_pixels + c] = value;
      }
    }
  };
}

Baseline upsampled_frame(const WindowSet& windows, std::span<const std::uint32_t> train) {
  const TaxelArray array = windows.array();
  const auto upsampling = bicubic_enlargement(array.rows, array.columns, windows.scale());
  // Of the frame that a window shows.
  const auto enlarge = [=, back = windows.delay_frames()](std::span<const float> input,
                                                          std::span<float> out) {
    check_input(input, array);
    const auto shown = input.last(array.signals() * (1 + back)).first(array.signals());
    upsampling(mean_of_channels(array, shown), out);
  };
  const std::size_t pixels = windows.image().pixels();
  std::vector<float> image(pixels), truth(pixels), input(windows.input_size());
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  const std::vector<std::uint32_t> chosen = fitted_on(train);
  for (const std::uint32_t i : chosen) {
    windows.window(i, input);
    enlarge(input, image);
    windows.truth(i, truth);
    for (std::size_t p = 0; p < pixels; ++p) {
      sx += image[p];
      sy += truth[p];
      sxx += static_cast<double>(image[p]) * image[p];
      sxy += static_cast<double>(image[p]) * truth[p];
    }
  }
  const double n = static_cast<double>(chosen.size()) * static_cast<double>(pixels);
  const double variance = sxx - sx * sx / n;
  const double slope = variance > 1e-12 * n ? (sxy - sx * sy / n) / variance : 0;
  const double intercept = (sy - slope * sx) / n;
  return {"bicubic", [=](auto window, auto out) {
            enlarge(window, out);
            for (float& v : out) v = static_cast<float>(slope * v + intercept);
          }};
}

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

// y[j] += sign * sum_k factors[k * step] * rows[k * stride + j], for j < count: the one loop of the linear
// algebra. Four rows at a time, so that y is loaded and stored once for them; a sum's order depends on
// nothing.
void add_rows(double* y, std::size_t count, double sign, const double* rows, std::size_t stride,
              const double* factors, std::size_t step, std::size_t n) {
  std::size_t k = 0;
  for (; k + 4 <= n; k += 4) {
    const double *r0 = rows + k * stride, *r1 = r0 + stride, *r2 = r1 + stride, *r3 = r2 + stride;
    const double f0 = sign * factors[k * step], f1 = sign * factors[(k + 1) * step],
                 f2 = sign * factors[(k + 2) * step], f3 = sign * factors[(k + 3) * step];
    for (std::size_t j = 0; j < count; ++j) y[j] += f0 * r0[j] + f1 * r1[j] + f2 * r2[j] + f3 * r3[j];
  }
  for (; k < n; ++k) {
    const double f = sign * factors[k * step];
    for (std::size_t j = 0; j < count; ++j) y[j] += f * rows[k * stride + j];
  }
}

constexpr std::size_t kBlock = 64;  // windows whose features stay in the cache; rows between two looks

using Look = std::function<void()>;  // once a block

std::size_t blocks_of(std::size_t count) { return (count + kBlock - 1) / kBlock; }

// What least squares needs of a set of windows: X'X (its upper triangle), X'Y and Y'Y; all matrices are
// row-major.
struct Moments {
  std::size_t features, pixels;
  std::vector<double> xx, xy;
  double yy = 0;

  Moments(const WindowSet& windows, std::span<const std::uint32_t> indices, const Look& look)
      : features(features_of(windows.frames(), windows.array().signals())),
        pixels(windows.image().pixels()),
        xx(features * features),
        xy(features * pixels) {
    for (std::size_t first = 0; first < indices.size(); first += kBlock, look())
      add(windows, indices.subspan(first, std::min(kBlock, indices.size() - first)));
  }

  void add(const WindowSet& windows, std::span<const std::uint32_t> part) {
    const std::size_t f = features, p = pixels;
    std::vector<double> x(part.size() * f), y;
    std::vector<float> truth(p);
    std::vector<float> window(windows.frames() * windows.array().signals());
    for (std::size_t n = 0; n < part.size(); ++n) {
      windows.window(part[n], window);
      fill_features(window, windows.array().signals(), std::span(x).subspan(n * f, f));
      windows.truth(part[n], truth);
      y.insert(y.end(), truth.begin(), truth.end());
    }
#pragma omp parallel for schedule(dynamic, 8)
    for (std::size_t i = 0; i < f; ++i) {
      add_rows(&xx[i * (f + 1)], f - i, 1, &x[i], f, &x[i], f, part.size());
      add_rows(&xy[i * p], p, 1, y.data(), p, &x[i], f, part.size());
    }
    yy += dot(y, y);
  }

  Moments& operator+=(const Moments& other) {
    std::transform(xx.begin(), xx.end(), other.xx.begin(), xx.begin(), std::plus());
    std::transform(xy.begin(), xy.end(), other.xy.begin(), xy.begin(), std::plus());
    yy += other.yy;
    return *this;
  }

  // W [f][pixels], from U'U W = X'Y with the Cholesky factor U of X'X and the penalty
  std::vector<double> solve(double penalty, const Look& look) const {
    const std::size_t n = features, p = pixels;
    double mean = 0;
    for (std::size_t i = 0; i + 1 < n; ++i) mean += xx[i * (n + 1)] / static_cast<double>(n - 1);
    std::vector<double> u = xx, w = xy;
    // Taxels that never move leave rows of zeros; the floor keeps the matrix positive definite.
    for (std::size_t i = 0; i + 1 < n; ++i) u[i * (n + 1)] += penalty * mean + 1e-9;
    for (std::size_t i = 0; i < n; ++i) {
      double* row = &u[i * n];
      add_rows(row + i, n - i, -1, &u[i], n, &u[i], n, i);
      if (!(row[i] > 0)) throw std::runtime_error("ridge: X'X of the windows is not positive definite");
      const double scale = 1 / std::sqrt(row[i]);
      for (std::size_t j = i; j < n; ++j) row[j] *= scale;
      add_rows(&w[i * p], p, -1, w.data(), p, &u[i], n, i);
      for (std::size_t j = 0; j < p; ++j) w[i * p + j] /= row[i];
      if (i % kBlock == 0) look();
    }
    for (std::size_t i = n; i-- > 0;) {
      const double* row = &u[i * n];
      add_rows(&w[i * p], p, -1, w.data() + (i + 1) * p, p, row + i + 1, 1, n - 1 - i);
      for (std::size_t j = 0; j < p; ++j) w[i * p + j] /= row[i];
      if (i % kBlock == 0) look();
    }
    return w;
  }

  // |Y - X W|^2
  double error(const std::vector<double>& w, const Look& look) const {
    const std::size_t n = features, p = pixels;
    std::vector<double> product(w.size());
    for (std::size_t first = 0; first < n; first += kBlock, look()) {
#pragma omp parallel for
      for (std::size_t i = first; i < std::min(n, first + kBlock); ++i) {
        add_rows(&product[i * p], p, 1, w.data(), p, &xx[i], n, i);
        add_rows(&product[i * p], p, 1, &w[i * p], p, &xx[i * (n + 1)], 1, n - i);
      }
    }
    return yy - 2 * dot(w, xy) + dot(w, product);
  }

  static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  }
};

}  // namespace

Baseline ridge(const WindowSet& windows, std::span<const std::uint32_t> train, const FitProgress& progress) {
  const std::vector<std::uint32_t> chosen = fitted_on(train);
  // Whole passes judge the penalty, since neighbours of one pass are nearly the same.
  std::vector<std::size_t> pass = {0};  // of each window, counted
  for (std::size_t n = 1; n < chosen.size(); ++n)
    pass.push_back(pass.back() + (windows.pass_of(chosen[n]) != windows.pass_of(chosen[n - 1]) ? 1 : 0));
  const std::size_t passes = pass.back() + 1;
  std::vector<std::uint32_t> fit, judge;
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const bool held = passes == 1 ? n >= chosen.size() - chosen.size() / kHeldOut
                                  : pass[n] % kHeldOut == std::min(kHeldOut, passes) - 1;
    (held ? judge : fit).push_back(chosen[n]);
  }
  const std::size_t signals = windows.array().signals(), size = windows.frames() * signals,
                    pixels = windows.image().pixels(), features = features_of(windows.frames(), signals);
  const std::size_t all =
      blocks_of(fit.size()) + blocks_of(judge.size()) + (3 * std::size(kPenalties) + 2) * blocks_of(features);
  std::size_t done = 0;
  const Look look = [&] {
    ++done;
    if (progress) progress(done, all);
  };
  Moments moments(windows, fit, look);
  const Moments other(windows, judge, look);
  double least = 0, best = 0;
  for (const double penalty : kPenalties) {
    const double error = other.error(moments.solve(penalty, look), look);
    if (best == 0 || error < least) best = penalty, least = error;
  }
  const std::vector<double> w = (moments += other).solve(best, look);
  return {"ridge", [=, weights = std::vector<float>(w.begin(), w.end())](auto window, auto out) {
            expect_values("baseline", "window", size, window.size());
            expect_values("baseline", "image", pixels, out.size());
            std::vector<double> used(features);
            fill_features(window, signals, used);
            std::fill(out.begin(), out.end(), 0.0f);
            for (std::size_t f = 0; f < used.size(); ++f) {
              const float* row = weights.data() + f * pixels;
              for (std::size_t p = 0; p < pixels; ++p) out[p] += static_cast<float>(used[f]) * row[p];
            }
          }};
}

Baselines fit_baselines(const WindowSet& windows, std::span<const std::uint32_t> train,
                        const FitProgress& progress) {
  return {mean_image(windows, train), upsampled_frame(windows, train), ridge(windows, train, progress)};
}

}  // namespace supertac
