// What the eight lessons ask for. Arrays are row-major. Gradients are added to what is there: a value that is
// used twice has two of them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace lessons {

using Array = std::vector<double>;

// 1. The chain rule, scalar by scalar.
struct Step {
  enum Op { add, multiply, sigmoid } op;
  std::size_t a, b;  ///< what goes in (sigmoid takes a alone)
  std::size_t out;   ///< where the result goes
};
void run(const std::vector<Step>& tape, Array& values);
void run_back(const std::vector<Step>& tape, const Array& values, Array& gradients);

// 2. y[n,o] = bias[o] + sum_i x[n,i] w[i,o]
struct Table {
  std::size_t rows, in, out;
};
void linear(const Table& s, const Array& x, const Array& w, const Array& bias, Array& y);
void linear_gradient(const Table& s, const Array& x, const Array& w, const Array& gy, Array& gx, Array& gw,
                     Array& gbias);

// 3. y[l,o] = bias[o] + sum_k,i x[l stride + k - padding, i] w[k,i,o], zeros beyond both ends of x; and its
// transpose,
//    t[l stride + k - padding, o] = bias[o] + sum of z[l,i] w[k,i,o]
struct Line {
  std::size_t length, in, out;  ///< of what goes in
  std::size_t kernel, stride, padding;
  std::size_t out_length() const { return (length + 2 * padding - kernel) / stride + 1; }
  std::size_t transposed_length() const { return (length - 1) * stride + kernel - 2 * padding; }
};
void conv(const Line& s, const Array& x, const Array& w, const Array& bias, Array& y);
void conv_gradient(const Line& s, const Array& x, const Array& w, const Array& gy, Array& gx, Array& gw,
                   Array& gbias);
void conv_transpose(const Line& s, const Array& z, const Array& w, const Array& bias, Array& t);

// 4. One image: mean[c] of x[p,c] over its pixels p, and y[p,c] = a[p,c] + x[p,c] gate[c]
struct Image {
  std::size_t pixels, channels;
};
void channel_mean(const Image& s, const Array& x, Array& mean);
void channel_mean_gradient(const Image& s, const Array& gmean, Array& gx);
void gated_sum(const Image& s, const Array& a, const Array& x, const Array& gate, Array& y);
void gated_sum_gradient(const Image& s, const Array& x, const Array& gate, const Array& gy, Array& ga,
                        Array& gx, Array& ggate);

// 5. z = mean + exp(log_var / 2) eps, and the divergence of N(mean, exp(log_var)) from N(0,1), summed
void sample(const Array& mean, const Array& log_var, const Array& eps, Array& z);
void sample_gradient(const Array& log_var, const Array& eps, const Array& gz, Array& gmean, Array& glog_var);
double divergence(const Array& mean, const Array& log_var);
void divergence_gradient(const Array& mean, const Array& log_var, double g, Array& gmean, Array& glog_var);

// 6. SSIM of two images of side x side pixels in [0,1], uniform windows of 7 x 7, mean over their positions
double ssim(std::size_t side, const Array& x, const Array& truth);
void ssim_gradient(std::size_t side, const Array& x, const Array& truth, double g, Array& gx);

// 7. One step of Adam, the t-th from 1: moments m and v, parameters x
struct Rates {
  double rate = 1e-3, beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8;
};
void adam_step(const Rates& r, long t, const Array& g, Array& m, Array& v, Array& x);

// 8. Four safeguards, each against one of the thirteen failures.
/// 13: by what a gradient of this length is multiplied, so that it is not longer than `limit`.
double clip_factor(double norm, double limit);
/// 3: the gradient of clamp(x, -10, 10).
double clamp_gradient(double x, double gy);
/// 7: the variance of these numbers in single precision, never below 0.
float variance(std::span<const float> x);
/// 11: whether a window may hold these two times, one behind the other.
bool may_follow(double before_s, double after_s, double max_gap_s);

}  // namespace lessons
