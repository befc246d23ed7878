#include "autograd/ops/vae.h"

#include "autograd/checks.h"
#include "autograd/kernels/exp.h"
#include "autograd/kernels/sums.h"

namespace supertac {

using kernels::exp_same_bits;

// gmean = gz     glog_var = gz (z - mean) / 2
Variable sample_gaussian(const Variable& mean, const Variable& log_var, const Tensor& eps) {
  check_rank("sample_gaussian", "mean", mean, 2);
  check_same_shape("sample_gaussian", "mean", mean, "log_var", log_var);
  if (eps.shape() != mean.shape()) {
    refuse("sample_gaussian", "eps expects " + mean.shape().text() + ", got " + eps.shape().text());
  }
  Tensor z(mean.shape());
  const real *m = mean.value().data(), *lv = log_var.value().data();
  for (Dim i = 0; i < z.size(); ++i) z.data()[i] = m[i] + exp_same_bits(lv[i] / 2) * eps.data()[i];
  return record("sample_gaussian", z, {&mean, &log_var}, [](Backward& b) {
    const real *gz = b.gy().data(), *sample = b.y().data(), *center = b.value(0).data();
    Tensor *gm = b.grad_of(0), *gl = b.grad_of(1);
    for (Dim i = 0; i < b.gy().size(); ++i) {
      if (gm) gm->data()[i] += gz[i];
      if (gl) gl->data()[i] += gz[i] * (sample[i] - center[i]) / 2;
    }
  });
}

// gmean = g mean / N     glog_var = g (exp(log_var) - 1) / (2 N)
Variable kl_divergence(const Variable& mean, const Variable& log_var) {
  check_rank("kl_divergence", "mean", mean, 2);
  check_same_shape("kl_divergence", "mean", mean, "log_var", log_var);
  const Dim n = mean.dim(0);
  if (n == 0) refuse("kl_divergence", "mean is empty: " + mean.shape().text());
  const real *m = mean.value().data(), *lv = log_var.value().data();
  const double total = kernels::sum_lanes(mean.size(), [=](Dim i) {
    return static_cast<double>(1 + lv[i] - m[i] * m[i] - exp_same_bits(lv[i]));
  });
  const auto value = static_cast<real>(-0.5 * total / static_cast<double>(n));
  return record("kl_divergence", Tensor::full({}, value), {&mean, &log_var}, [n](Backward& b) {
    const real g = b.gy().item() / static_cast<real>(n);
    const real *center = b.value(0).data(), *spread = b.value(1).data();
    Tensor *gm = b.grad_of(0), *gl = b.grad_of(1);
    for (Dim i = 0; i < b.value(0).size(); ++i) {
      if (gm) gm->data()[i] += g * center[i];
      if (gl) gl->data()[i] += g * (exp_same_bits(spread[i]) - 1) / 2;
    }
  });
}

}  // namespace supertac
