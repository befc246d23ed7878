#include "autograd/ops/vae.h"

#include "autograd/kernels/exp.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

using kernels::exp_same_bits;

// mean, log_var, eps, z [N,LD];  z = mean + e^(log_var / 2) eps
// gmean = gz     glog_var = gz (z - mean) / 2, which is half of e^(log_var / 2) eps
Variable sample_gaussian(const Variable& mean, const Variable& log_var, const Tensor& eps) {
  check_rank("sample_gaussian", "mean", mean, 2);
  check_same_shape("sample_gaussian", "mean", mean, "log_var", log_var);
  if (eps.shape() != mean.shape()) refuse("sample_gaussian", "eps", mean.shape().text(), eps.text());
  Tensor z(mean.shape());
  each(z.size(), [m = mean.value().data(), v = log_var.value().data(), e = eps.data(), to = z.data()](Dim i) {
    to[i] = m[i] + exp_same_bits(v[i] / 2) * e[i];
  });
  const auto reverse = [](Backward& g) {
    const real *gz = g.gy().data(), *sample = g.y().data(), *m = g.value(0).data();
    add_to_gradient(g, 0, [=](Dim i) { return gz[i]; });
    add_to_gradient(g, 1, [=](Dim i) { return gz[i] * (sample[i] - m[i]) / 2; });
  };
  const OpSettings settings{.constant = eps};
  return record("sample_gaussian", z, {&mean, &log_var}, reverse, &settings);
}

// mean, log_var [N,LD];  value [] = -1/2N sum of 1 + log_var - mean^2 - e^log_var
// gmean = gy mean / N     glog_var = gy (e^log_var - 1) / (2 N)
Variable kl_divergence(const Variable& mean, const Variable& log_var) {
  check_rank("kl_divergence", "mean", mean, 2);
  check_same_shape("kl_divergence", "mean", mean, "log_var", log_var);
  const Dim rows = mean.dim(0);
  if (rows == 0) refuse("kl_divergence", "mean", "a row or more", mean.shape().text());
  const double total =
      -0.5 * kernels::sum_of(mean.size(), [m = mean.value().data(), v = log_var.value().data()](Dim i) {
        return 1 + v[i] - m[i] * m[i] - exp_same_bits(v[i]);
      });
  const auto value = static_cast<real>(total / static_cast<double>(rows));
  return record("kl_divergence", Tensor::full({}, value), {&mean, &log_var}, [rows](Backward& g) {
    const real each_row = g.gy().item() / static_cast<real>(rows);
    const real *m = g.value(0).data(), *v = g.value(1).data();
    add_to_gradient(g, 0, [=](Dim i) { return each_row * m[i]; });
    add_to_gradient(g, 1, [=](Dim i) { return each_row * (exp_same_bits(v[i]) - 1) / 2; });
  });
}

}  // namespace supertac
