// Adam (Kingma & Ba 2015, algorithm 1) with bias correction and clipping of the gradient norm; and Muon
// (Jordan et al. 2024) for matrices of weights, as an option. Schedule gives the learning rate over a
// training.
#pragma once

#include <cstdint>
#include <vector>

#include "autograd/variable.h"

namespace supertac {

struct AdamOptions {
  double learning_rate = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;
  /// The gradient is scaled down to this L2 norm over all parameters when it is longer; 0 = never.
  double clip_norm = 0;
  /// Matrices (is_matrix) take Muon's step, all other parameters Adam's.
  bool muon = false;
};

/// Root mean square of a weight's step by Muon, in learning rates: about that of Adam's steps (Liu et al.
/// 2025). Longer steps do better on the same trial and worse on others (bench/results/parts.md).
inline constexpr double kMuonLength = 0.2;

/// Whether Muon moves it: [..., columns], eight or more columns (the outputs of a convolution or a linear
/// layer) and eight or more rows (all that feeds one of them).
bool is_matrix(const Shape& shape);

/// x [rows, columns] <- nearly U V^T, where U S V^T is its singular value decomposition, by five steps of
/// Newton and Schulz from X = x / (|x| + 1e-7), |x| being the L2 norm of all elements:
///
///     X <- a X + b (X X^T) X + c (X X^T)^2 X,   a = 3.4445, b = -4.7750, c = 2.0315
///
/// (Jordan et al. 2024, "Muon: An optimizer for hidden layers in neural networks"). They bring singular
/// values above 0.01 |x| to between 0.6 and 1.3; these coefficients are fast and do not converge to 1. All
/// steps are polynomials of the smaller of X X^T and X^T X and are taken on that.
void orthogonalise(Dim rows, Dim columns, real* x);

class Adam {
 public:
  /// Keeps handles to the parameters and sets their gradients to zero. Throws std::invalid_argument unless
  /// learning_rate, clip_norm >= 0, 0 <= beta < 1, epsilon > 0, and every parameter requires a gradient.
  Adam(std::vector<Variable> parameters, const AdamOptions& options);

  /// Sets every gradient to zero; call it before backward().
  void zero_grad();
  /// m = b1 m + (1-b1) g;  v = b2 v + (1-b2) g^2;  x -= lr (m / (1-b1^t)) / (sqrt(v / (1-b2^t)) + epsilon).
  ///
  /// For a matrix [R,C] with `muon`, O(X) as orthogonalise():
  /// m = 0.95 m + 0.05 g;  x -= kMuonLength lr sqrt(max(R,C)) O(0.95 m + 0.05 g)
  /// (Jordan et al. 2024; the root, which gives matrices of any shape steps of one length: Liu et al. 2025,
  /// arXiv 2502.16982, eq. 4). Its second moment stays 0.
  ///
  /// Throws std::invalid_argument where a parameter has no gradient (who takes it away has to run backward()
  /// before) or one of another shape.
  ///
  /// Returns the gradient's norm before clipping, infinity when the square of the clipped one overflows
  /// `real`. When it is not finite nothing is changed: check it.
  double step();
  void set_learning_rate(double rate) { options_.learning_rate = rate; }

  std::int64_t steps() const { return steps_; }
  /// For exact resume: the moments in parameter order, and the step count that belongs to them.
  std::vector<Tensor>& first_moments() { return m_; }
  std::vector<Tensor>& second_moments() { return v_; }
  void set_steps(std::int64_t steps) { steps_ = steps; }

 private:
  void move_matrices(real clip);

  std::vector<Variable> parameters_;
  AdamOptions options_;
  std::vector<std::size_t> matrices_, others_;  // of parameters_
  std::vector<double> squares_;                 // summed, of each gradient
  std::vector<Tensor> m_, v_;
  std::int64_t steps_ = 0;
};

/// The learning rate at `step` (from 0) of `total`: a linear rise over `warm_up` steps to `peak`, then half a
/// cosine down to 0 (Loshchilov & Hutter 2017, eq. 5, one period), which it stays behind `total`; `peak` for
/// ever where `total` is not above `warm_up`.
struct Schedule {
  double peak = 1e-3;
  std::int64_t warm_up = 0;
  std::int64_t total = 1;
  double at(std::int64_t step) const;
};

}  // namespace supertac
