#include "autograd/ops/vae.h"

#include "autograd/kernels/losses.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

// mean, log_var, eps, z [N,LD];  z = mean + e^(log_var / 2) eps
// gmean = gz     glog_var = gz (z - mean) / 2
Variable sample_gaussian(const Variable& mean, const Variable& log_var, const Tensor& eps) {
  check_rank("sample_gaussian", "mean", mean, 2);
  check_same_shape("sample_gaussian", "mean", mean, "log_var", log_var);
  if (eps.shape() != mean.shape()) refuse("sample_gaussian", "eps", mean.shape().text(), eps.text());
  Tensor z(mean.shape());
  kernels::sample_gaussian(z.size(), mean.value().data(), log_var.value().data(), eps.data(), z.data());
  const auto reverse = [](Backward& g) {
    const Tensor &gz = g.gy(), &sample = g.y(), &m = g.value(0);
    const Slot gmean = g.slot_of(0), glog_var = g.slot_of(1);
    kernels::sample_gaussian_grad(gz.size(), gz.data(), sample.data(), m.data(), gmean, glog_var);
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
  const double total = kernels::kl_divergence(mean.size(), mean.value().data(), log_var.value().data());
  const auto value = static_cast<real>(total / static_cast<double>(rows));
  return record("kl_divergence", Tensor::full({}, value), {&mean, &log_var}, [rows](Backward& g) {
    const real each_row = g.gy().item() / static_cast<real>(rows);
    const Tensor &m = g.value(0), &v = g.value(1);
    const Slot gmean = g.slot_of(0), glog_var = g.slot_of(1);
    kernels::kl_divergence_grad(m.size(), each_row, m.data(), v.data(), gmean, glog_var);
  });
}

}  // namespace supertac
