// tests/models/networks/ops_parity_test.cpp has the values and gradients of these ops. By their rows in
// apps/check/gradient_cases.cpp `supertac-check gradients` compares these with differences, and
// tests/layers/gradient_test.cpp tries the ops empty and with planted errors.
#include "autograd/ops/vae.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::vae_test {

using namespace test;

// A collapsed posterior: the divergence is tiny, and rounding may not make it negative by more than its size.
TEST(KlDivergence, NearTheStandardNormal) {
  const Variable mean(Tensor::full({1, 1}, real(1e-2))), log_var(Tensor::full({1, 1}, real(-1e-2)));
  const double exact = -0.5 * (1 - 1e-2 - 1e-4 - std::exp(-1e-2));
  EXPECT_NEAR(static_cast<double>(kl_divergence(mean, log_var).item()), exact, 1e-7);
}

TEST(Vae, RefusesOtherShapes) {
  const Variable a(Tensor::zeros({2, 3})), b(Tensor::zeros({3, 2})), c(Tensor::zeros({2}));
  EXPECT_REFUSAL("sample_gaussian: mean expects rank 2, got [2]", sample_gaussian(c, c, Tensor::zeros({2})));
  EXPECT_REFUSAL("sample_gaussian: log_var expects the shape of mean, [2,3], got [3,2]",
                 sample_gaussian(a, b, Tensor::zeros({2, 3})));
  EXPECT_REFUSAL("sample_gaussian: eps expects [2,3], got [3,2]",
                 sample_gaussian(a, a, Tensor::zeros({3, 2})));
  EXPECT_REFUSAL("sample_gaussian: eps expects [2,3], got none", sample_gaussian(a, a, Tensor()));
  EXPECT_REFUSAL("kl_divergence: mean expects rank 2, got [2]", kl_divergence(c, c));
  EXPECT_REFUSAL("kl_divergence: mean expects a row or more, got [0,3]",
                 kl_divergence(zeros({0, 3}), zeros({0, 3})));
  EXPECT_REFUSAL("kl_divergence: log_var expects the shape of mean, [2,3], got [3,2]", kl_divergence(a, b));
}

}  // namespace supertac::vae_test
