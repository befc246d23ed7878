#include "autograd/ops/vae.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::vae_test {

using namespace test;

TEST(SampleGaussian, HandComputed) {
  const Variable mean(Tensor::of({1, 2}, {1, -2})), log_var(Tensor::of({1, 2}, {0, real(std::log(4.0))}));
  const Variable z = sample_gaussian(mean, log_var, Tensor::of({1, 2}, {3, real(0.5)}));
  EXPECT_VALUES(z.value(), {1, 2}, {4, -1});
}

TEST(KlDivergence, HandComputed) {
  const auto of = [](real mean, real log_var) {
    return static_cast<double>(
        kl_divergence(Variable(Tensor::full({1, 1}, mean)), Variable(Tensor::full({1, 1}, log_var))).item());
  };
  EXPECT_NEAR(of(0, 0), 0, kRounding);
  EXPECT_NEAR(of(3, 0), 4.5, 5 * kRounding);
  EXPECT_NEAR(of(0, 1), 0.5 * (std::exp(1.0) - 2), kRounding);
  // summed over latents, averaged over the batch
  const Variable mean(Tensor::full({4, 3}, 2)), log_var(Tensor::zeros({4, 3}));
  EXPECT_NEAR(static_cast<double>(kl_divergence(mean, log_var).item()), 6, 10 * kRounding);
}

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
