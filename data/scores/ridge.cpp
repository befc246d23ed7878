#include "data/scores/ridge.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <stdexcept>

#include "data/samples/split.h"

namespace supertac {
namespace {

using Matrix = Eigen::MatrixXd;

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
void features(std::span<const float> window, std::size_t signals, std::span<double> out) {
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

// What least squares needs of a set of windows: X'X, X'Y and Y'Y.
struct Moments {
  Matrix xx, xy;
  double yy = 0;

  Moments(std::size_t features, std::size_t pixels)
      : xx(Matrix::Zero(static_cast<Eigen::Index>(features), static_cast<Eigen::Index>(features))),
        xy(Matrix::Zero(static_cast<Eigen::Index>(features), static_cast<Eigen::Index>(pixels))) {}

  Moments(const WindowSet& windows, std::span<const std::uint32_t> indices)
      : Moments(features_of(static_cast<std::size_t>(windows.timesteps()), windows.array().signals()),
                windows.image().pixels()) {
    constexpr std::size_t kBlock = 512;
    std::vector<float> truth(static_cast<std::size_t>(xy.cols()));
    std::vector<float> window(static_cast<std::size_t>(windows.timesteps()) * windows.array().signals());
    for (std::size_t first = 0; first < indices.size(); first += kBlock) {
      const auto part = indices.subspan(first, std::min(kBlock, indices.size() - first));
      Matrix x(xx.rows(), static_cast<Eigen::Index>(part.size()));  // a window a column
      Matrix y(xy.cols(), x.cols());
      for (Eigen::Index n = 0; n < x.cols(); ++n) {
        const std::uint32_t i = part[static_cast<std::size_t>(n)];
        windows.window(i, window);
        features(window, windows.array().signals(), {x.col(n).data(), static_cast<std::size_t>(x.rows())});
        windows.truth(i, truth);
        y.col(n) = Eigen::Map<const Eigen::VectorXf>(truth.data(), y.rows()).cast<double>();
      }
      xx.noalias() += x * x.transpose();
      xy.noalias() += x * y.transpose();
      yy += y.squaredNorm();
    }
  }

  Moments& operator+=(const Moments& other) {
    xx += other.xx;
    xy += other.xy;
    yy += other.yy;
    return *this;
  }

  Matrix solve(double penalty) const {
    const Eigen::Index n = xx.rows() - 1;
    Matrix a = xx;
    // Taxels that never move leave rows of zeros; the floor keeps the matrix positive definite.
    a.diagonal().head(n).array() += penalty * xx.diagonal().head(n).mean() + 1e-9;
    return a.llt().solve(xy);
  }

  // |Y - X W|^2
  double error(const Matrix& w) const {
    return yy - 2 * w.cwiseProduct(xy).sum() + w.cwiseProduct(xx * w).sum();
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
  const Matrix w = (moments += other).solve(penalty_).transpose();  // [pixels][f]; columns are contiguous
  weights_.resize(static_cast<std::size_t>(w.size()));
  std::transform(w.data(), w.data() + w.size(), weights_.begin(),
                 [](double v) { return static_cast<float>(v); });
}

void Ridge::predict(std::span<const float> window, std::span<float> out) const {
  if (window.size() != timesteps_ * signals_ || out.size() != pixels_) {
    throw std::invalid_argument("ridge: expects a window [" + std::to_string(timesteps_) + "][" +
                                std::to_string(signals_) + "] and " + std::to_string(pixels_) +
                                " pixels, got " + std::to_string(window.size()) + " and " +
                                std::to_string(out.size()) + " values");
  }
  std::vector<double> used(features_of(timesteps_, signals_));
  features(window, signals_, used);
  std::fill(out.begin(), out.end(), 0.0f);
  for (std::size_t f = 0; f < used.size(); ++f) {
    const float* row = weights_.data() + f * pixels_;
    for (std::size_t p = 0; p < pixels_; ++p) out[p] += static_cast<float>(used[f]) * row[p];
  }
}

}  // namespace supertac
