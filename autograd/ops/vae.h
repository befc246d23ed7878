// The two ops a variational auto-encoder adds (Kingma & Welling 2014, eq. 10).
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// z = mean + exp(log_var / 2) eps, with eps ~ N(0,1) drawn by the caller; all [N,LD]. No gradient flows into
/// eps, which is read at once. Both throw std::invalid_argument when mean is not of rank 2 or the shapes
/// differ.
Variable sample_gaussian(const Variable& mean, const Variable& log_var, const Tensor& eps);

/// The divergence of N(mean, exp(log_var)) from N(0,1), summed over latent dimensions, averaged over the
/// batch: -1/2 / N * sum over n, i of (1 + log_var - mean^2 - exp(log_var)). A scalar; inputs [N,LD].
/// It also throws when the batch is empty (N = 0).
Variable kl_divergence(const Variable& mean, const Variable& log_var);

}  // namespace supertac
