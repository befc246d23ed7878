#include <cmath>

#include "lessons.h"

namespace lessons {

void sample(const Array& mean, const Array& log_var, const Array& eps, Array& z) {
  for (std::size_t i = 0; i < z.size(); ++i) z[i] = mean[i] + std::exp(log_var[i] / 2) * eps[i];
}

void sample_gradient(const Array& log_var, const Array& eps, const Array& gz, Array& gmean, Array& glog_var) {
  for (std::size_t i = 0; i < gz.size(); ++i) {
    gmean[i] += gz[i];
    glog_var[i] += gz[i] * std::exp(log_var[i] / 2) * eps[i] / 2;
  }
}

double divergence(const Array& mean, const Array& log_var) {
  double sum = 0;
  for (std::size_t i = 0; i < mean.size(); ++i)
    sum -= 0.5 * (1 + log_var[i] - mean[i] * mean[i] - std::exp(log_var[i]));
  return sum;
}

void divergence_gradient(const Array& mean, const Array& log_var, double g, Array& gmean, Array& glog_var) {
  for (std::size_t i = 0; i < mean.size(); ++i) {
    gmean[i] += g * mean[i];
    glog_var[i] += g * (std::exp(log_var[i]) - 1) / 2;
  }
}

}  // namespace lessons
