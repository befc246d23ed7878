// Adam (Kingma & Ba 2015, algorithm 1) with bias correction and clipping of the gradient norm; and Muon, by
// which matrices of weights move on request.
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
  /// Matrices move as Muon has it, whatever else there is as Adam has it.
  bool muon = false;
};

/// How long a weight's step by Muon is (root mean square), in learning rates: as long as Adam's usually are
/// (Liu et al. 2025). Short trainings learn more with longer ones, unseen trials are drawn worse
/// (bench/results).
inline constexpr double kMuonLength = 0.2;

/// Whether Muon moves it: [..., columns], eight or more columns (the outputs of a convolution or a linear
/// layer) and eight or more rows (all that feeds one of them).
bool is_matrix(const Shape& shape);

class Adam {
 public:
  /// Throws std::invalid_argument for rates outside their ranges or parameters without gradients.
  Adam(std::vector<Variable> parameters, const AdamOptions& options);

  /// Sets every gradient to zero; call it before backward().
  void zero_grad();
  /// m = b1 m + (1-b1) g;  v = b2 v + (1-b2) g^2;  x -= lr (m / (1-b1^t)) / (sqrt(v / (1-b2^t)) + epsilon).
  ///
  /// Of a matrix [R,C] with `muon`, where O makes it orthogonal (autograd/optimisers/orthogonal.h):
  /// m = .95 m + .05 g;  x -= kMuonLength lr sqrt(max(R,C)) O(.95 m + .05 g)
  /// (Jordan et al. 2024; the root, by which matrices of any shape take steps of one length: Liu et al. 2025,
  /// arXiv 2502.16982, eq. 4). Its second moment stays 0.
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
  std::vector<Tensor> m_, v_;
  std::int64_t steps_ = 0;
};

}  // namespace supertac
