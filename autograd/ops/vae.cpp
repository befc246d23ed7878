#include "autograd/ops/vae.h"

#include "autograd/checks.h"
#include "autograd/kernels/elementwise.h"
#include "autograd/kernels/losses.h"

namespace supertac {

// gmean = gz     glog_var = gz (z - mean) / 2
Variable sample_gaussian(const Variable& mean, const Variable& log_var, const Tensor& eps) {
  check_rank("sample_gaussian", "mean", mean, 2);
  check_same_shape("sample_gaussian", "mean", mean, "log_var", log_var);
  if (eps.shape() != mean.shape()) {
    refuse("sample_gaussian", "eps expects " + mean.shape().text() + ", got " + eps.shape().text());
  }
  Tensor z(mean.shape());
  kernels::sample_gaussian(z.size(), mean.value().data(), log_var.value().data(), eps.data(), z.data());
  return record("sample_gaussian", z, {&mean, &log_var}, [](Backward& b) {
    const Dim n = b.gy().size();
    const real* gz = b.gy().data();
    if (Tensor* g = b.grad_of(0)) kernels::add_scaled(n, 1, gz, g->data());
    if (Tensor* g = b.grad_of(1)) {
      kernels::sample_gaussian_grad_log_var(n, gz, b.y().data(), b.value(0).data(), g->data());
    }
  });
}

// gmean = g mean / N     glog_var = g (exp(log_var) - 1) / (2 N)
Variable kl_divergence(const Variable& mean, const Variable& log_var) {
  check_rank("kl_divergence", "mean", mean, 2);
  check_same_shape("kl_divergence", "mean", mean, "log_var", log_var);
  const Dim rows = mean.dim(0);
  if (rows == 0) refuse("kl_divergence", "mean is empty: " + mean.shape().text());
  const double total = kernels::kl_terms(mean.size(), mean.value().data(), log_var.value().data());
  const auto value = static_cast<real>(-0.5 * total / static_cast<double>(rows));
  return record("kl_divergence", Tensor::full({}, value), {&mean, &log_var}, [rows](Backward& b) {
    const real each = b.gy().item() / static_cast<real>(rows);
    const Dim n = b.value(0).size();
    if (Tensor* g = b.grad_of(0)) kernels::add_scaled(n, each, b.value(0).data(), g->data());
    if (Tensor* g = b.grad_of(1)) kernels::kl_grad_log_var(n, each, b.value(1).data(), g->data());
  });
}

}  // namespace supertac
