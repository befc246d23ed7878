// The same command gives the same bytes for any number of threads.
#include <omp.h>

#include <cstring>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/losses.h"
#include "autograd/optimisers/adam.h"
#include "tests/autograd/check.h"

namespace supertac {
namespace {

using namespace test;

// Three training steps, large enough that every kernel is shared out; all parameters, gradients and losses.
std::vector<real> train(int threads) {
  const int before = omp_get_max_threads();
  omp_set_num_threads(threads);
  std::vector<Variable> p{parameter(numbers({3, 3, 1, 32}, 1)),  parameter(numbers({32}, 2)),
                          parameter(numbers({3, 3, 32, 32}, 3)), parameter(numbers({32}, 4)),
                          parameter(numbers({4, 4, 32, 32}, 5)), parameter(numbers({32}, 6)),
                          parameter(numbers({3, 3, 32, 1}, 7)),  parameter(numbers({1}, 8))};
  const Tensor x = numbers({9, 10, 10, 1}, 9, 0, 1), truth = numbers({9, 20, 20, 1}, 10, 0, 1);
  const ConvOptions same{.padding = 1};
  Adam adam(p, {.clip_norm = 1, .muon = true});
  std::vector<real> all;
  for (int step = 0; step < 3; ++step) {
    Variable h = leaky_relu(conv2d(Variable(x), p[0], p[1], same));
    h = conv2d(h, p[2], p[3], same);
    h = gated_sum(h, h, sigmoid(global_mean(h)));
    h = leaky_relu(conv_transpose2d(h, p[4], p[5], {.stride = 2, .padding = 1}));
    const Variable y = real(0.01) * conv2d(h, p[6], p[7], same);
    const Variable loss = l2_loss(y, Variable(truth)) - ssim(y, truth);
    adam.zero_grad();
    backward(loss);
    all.push_back(loss.item());
    all.push_back(static_cast<real>(adam.step()));
  }
  for (const Variable& v : p) {
    all.insert(all.end(), v.value().values().begin(), v.value().values().end());
    all.insert(all.end(), v.grad().values().begin(), v.grad().values().end());
  }
  omp_set_num_threads(before);
  return all;
}

TEST(Threads, TrainingGivesTheSameBytes) {
  const std::vector<real> one = train(1);
  for (const real x : one) ASSERT_TRUE(std::isfinite(x));
  for (const int threads : {2, 3, 7}) {
    const std::vector<real> many = train(threads);
    ASSERT_EQ(many.size(), one.size());
    EXPECT_EQ(std::memcmp(many.data(), one.data(), one.size() * sizeof(real)), 0) << threads << " threads";
  }
}

TEST(Threads, LongSumsGiveTheSameBytes) {
  const Variable x(numbers({1, 300'001}));
  omp_set_num_threads(1);
  const real one = sum(x).item();
  omp_set_num_threads(3);
  EXPECT_EQ(sum(x).item(), one);
  omp_set_num_threads(1);
}

}  // namespace
}  // namespace supertac
