#include "autograd/optimisers/adam.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::adam_test {

using namespace test;

struct Single {
  Variable x = parameter(Tensor::full({1}, 1));
  Adam adam;
  explicit Single(const AdamOptions& options) : adam({x}, options) {}
  double step(double gradient) {
    x.mutable_grad().fill(static_cast<real>(gradient));
    return adam.step();
  }
  double value() const { return static_cast<double>(x.item()); }
};

// The formula in double precision.
struct Reference {
  double x = 1, m = 0, v = 0;
  int t = 0;
  void step(double g, const AdamOptions& o) {
    ++t;
    m = o.beta1 * m + (1 - o.beta1) * g;
    v = o.beta2 * v + (1 - o.beta2) * g * g;
    x -= o.learning_rate * (m / (1 - std::pow(o.beta1, t))) /
         (std::sqrt(v / (1 - std::pow(o.beta2, t))) + o.epsilon);
  }
};

TEST(Adam, FollowsTheFormula) {
  const AdamOptions options{.learning_rate = 0.05, .beta1 = 0.8, .beta2 = 0.99, .epsilon = 1e-2};
  Single s(options);
  Reference r;
  for (int i = 0; i < 200; ++i) {
    const double g = std::sin(0.3 * i) + 0.2;
    s.step(g);
    r.step(g, options);
    ASSERT_NEAR(s.value(), r.x, 2e-5) << "step " << i;
  }
}

TEST(Adam, ZeroGradientsForALongTimeChangeNothing) {
  Single s({.learning_rate = 0.1});
  for (int i = 0; i < 100; ++i) s.step(1);
  for (int i = 0; i < 100'000; ++i) s.step(0);
  const double rested = s.value();
  for (int i = 0; i < 1000; ++i) s.step(0);
  EXPECT_EQ(s.value(), rested);
  EXPECT_TRUE(std::isfinite(rested));
  EXPECT_EQ(s.adam.first_moments()[0].item(), 0);  // not a denormal number, which would be slow for ever
  EXPECT_EQ(s.adam.second_moments()[0].item(), 0);
  s.step(1);
  EXPECT_NEAR(s.value(), rested - 0.1 * 0.1 / std::sqrt(1e-3), 1e-3);  // a fresh start, bias correction gone
}

// g^2 beyond fp32 would make the second moment infinite and the parameter immovable for ever.
TEST(Adam, AGradientWhoseSquareOverflowsIsRefusedLikeInfinity) {
  Single s({});
  EXPECT_FALSE(std::isfinite(s.step(1e30)));
  EXPECT_EQ(s.value(), 1);
  EXPECT_EQ(s.adam.steps(), 0);
  Single clipped({.clip_norm = 1});
  EXPECT_NEAR(clipped.step(1e30) / 1e30, 1, 1e-6);
  EXPECT_NEAR(clipped.value(), 1 - 1e-3, 1e-6);
}

TEST(Adam, NonFiniteGradientsLeaveEverythingUnchanged) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const Variable a = parameter(Tensor::full({3}, 1)), b = parameter(Tensor::full({2}, 2));
    Adam adam({a, b}, {.clip_norm = 1});
    Variable(a).mutable_grad().fill(1);
    Variable(b).mutable_grad().data()[1] = static_cast<real>(bad);
    EXPECT_FALSE(std::isfinite(adam.step()));
    EXPECT_EQ(adam.steps(), 0);
    EXPECT_VALUES(a.value(), {3}, {1, 1, 1});
    EXPECT_VALUES(b.value(), {2}, {2, 2});
    EXPECT_VALUES(adam.first_moments()[0], {3}, {0, 0, 0});
    EXPECT_VALUES(adam.second_moments()[0], {3}, {0, 0, 0});
  }
}

TEST(Adam, ClipsTheNormOverAllParameters) {
  const Variable a = parameter(Tensor::zeros({1})), b = parameter(Tensor::zeros({1}));
  Adam adam({a, b}, {.clip_norm = 1});
  Variable(a).mutable_grad().fill(3);
  Variable(b).mutable_grad().fill(4);
  EXPECT_NEAR(adam.step(), 5, 1e-12);  // the norm before clipping
  EXPECT_NEAR(static_cast<double>(adam.first_moments()[0].item()), 0.1 * 0.6, 1e-7);
  EXPECT_NEAR(static_cast<double>(adam.first_moments()[1].item()), 0.1 * 0.8, 1e-7);
  Single below({.clip_norm = 1});
  below.step(0.5);
  EXPECT_NEAR(static_cast<double>(below.adam.first_moments()[0].item()), 0.05, 1e-8);
}

TEST(Adam, RefusesAStepWithoutAGradient) {
  Variable x = parameter(Tensor::zeros({2, 3}));
  Adam adam({x}, {});
  x.mutable_grad() = Tensor();
  EXPECT_REFUSAL("Adam: parameter 0 expects a gradient [2,3], got none; run backward() before step()",
                 adam.step());
  x.mutable_grad() = Tensor::zeros({2});
  EXPECT_REFUSAL("Adam: parameter 0 expects a gradient [2,3], got [2]; run backward() before step()",
                 adam.step());
}

TEST(Adam, RefusesBadOptions) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [options, text] :
       {std::pair(AdamOptions{.learning_rate = -1}, "learning_rate expects 0 or more, got -1"),
        {AdamOptions{.learning_rate = nan}, "learning_rate expects 0 or more, got nan"},
        {AdamOptions{.beta1 = 1}, "beta1 expects a number in [0,1), got 1"},
        {AdamOptions{.beta2 = -0.1}, "beta2 expects a number in [0,1), got -0.1"},
        {AdamOptions{.epsilon = 0}, "epsilon expects more than 0, got 0"},
        {AdamOptions{.clip_norm = -1}, "clip_norm expects 0 or more, got -1"}}) {
    const AdamOptions& bad = options;
    EXPECT_REFUSAL("Adam: " + std::string(text), Adam({parameter(Tensor::zeros({1}))}, bad));
  }
  EXPECT_REFUSAL("Adam: parameter 0 expects a variable that requires a gradient, got a constant",
                 Adam({zeros({1})}, {}));
}

TEST(Muon, MovesMatricesAlongTheOrthogonalFactorAndTheRestAsAdam) {
  const Tensor start = numbers({16, 24}), gradient = numbers({16, 24}, 2);
  const Variable w = parameter(start.clone()), b = parameter(Tensor::zeros({24}));
  const Variable alone = parameter(Tensor::zeros({24}));
  Adam muon({w, b}, {.learning_rate = 0.01, .muon = true}), adam({alone}, {.learning_rate = 0.01});
  for (int step = 0; step < 3; ++step) {  // of one gradient: the momentum points along it
    Variable(w).mutable_grad() = gradient.clone();
    Variable(b).mutable_grad() = Variable(alone).mutable_grad() = numbers({24}, 3);
    muon.step(), adam.step();
  }
  EXPECT_TRUE(same_bytes(b.value(), alone.value()));
  Tensor along = gradient.clone();
  orthogonalise(16, 24, along.data());
  const double length = 3 * kMuonLength * 0.01 * std::sqrt(24.0);
  for (Dim i = 0; i < start.size(); ++i) {
    ASSERT_NEAR(static_cast<double>(w.value().data()[i]),
                static_cast<double>(start.data()[i]) - length * static_cast<double>(along.data()[i]), 1e-5);
  }
  for (const real v : muon.second_moments()[0].values()) ASSERT_EQ(v, 0);
}

TEST(Muon, WithoutAGradientNothingMoves) {
  const Variable w = parameter(numbers({8, 9}));
  Adam muon({w}, {.learning_rate = 0.1, .muon = true});
  for (int step = 0; step < 10; ++step) muon.step();
  EXPECT_TRUE(same_bytes(w.value(), numbers({8, 9})));
  Variable(w).mutable_grad() = numbers({8, 9}, 2);
  muon.step();
  Variable(w).mutable_grad().fill(0);
  for (int step = 0; step < 3000; ++step) muon.step();  // the momentum dies away, and with it the steps
  const Tensor rested = w.value().clone();
  for (int step = 0; step < 100; ++step) muon.step();
  EXPECT_TRUE(same_bytes(w.value(), rested));
  EXPECT_EQ(muon.first_moments()[0].data()[0], 0);
}

TEST(Muon, TakesForMatricesWhatHasEightRowsAndColumns) {
  for (const Shape& shape : {Shape{8, 8}, Shape{3, 3, 1, 32}, Shape{4, 4, 16}})
    EXPECT_TRUE(is_matrix(shape)) << shape.text();
  for (const Shape& shape : {Shape{64}, Shape{64, 7}, Shape{7, 64}, Shape{3, 3, 32, 1}, Shape{}})
    EXPECT_FALSE(is_matrix(shape)) << shape.text();
}

using Matrix = std::vector<double>;

// a [n,k] times b [k,m], or times the transposed of b [m,k].
Matrix product(Dim n, Dim k, Dim m, const Matrix& a, const Matrix& b, bool transposed = false) {
  Matrix y(static_cast<std::size_t>(n * m));
  for (Dim i = 0; i < n * m; ++i)
    for (Dim l = 0; l < k; ++l) {
      const Dim of_b = transposed ? i % m * k + l : l * m + i % m;
      y[static_cast<std::size_t>(i)] +=
          a[static_cast<std::size_t>(i / m * k + l)] * b[static_cast<std::size_t>(of_b)];
    }
  return y;
}

// The steps as the header has them, on x itself, in double precision.
Matrix reference(Dim rows, Dim columns, Matrix x) {
  const double length = std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
  for (double& v : x) v /= length + 1e-7;
  for (int step = 0; step < 5; ++step) {
    const Matrix s = product(rows, columns, rows, x, x, true);
    const Matrix sx = product(rows, rows, columns, s, x), ssx = product(rows, rows, columns, s, sx);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = 3.4445 * x[i] - 4.7750 * sx[i] + 2.0315 * ssx[i];
  }
  return x;
}

Matrix values_of(const Tensor& x) { return {x.values().begin(), x.values().end()}; }

TEST(Orthogonal, TakesTheStepsOfItsFormula) {
  for (const auto& [rows, columns] : {std::pair<Dim, Dim>{288, 32}, {64, 512}, {8, 8}, {12, 16}, {80, 9}}) {
    Tensor x = numbers({rows, columns}, 7);
    const Matrix expected = reference(rows, columns, values_of(x));
    orthogonalise(rows, columns, x.data());
    const Matrix found = values_of(x);
    for (std::size_t i = 0; i < found.size(); ++i)
      ASSERT_NEAR(found[i], expected[i], 2e-4) << rows << " x " << columns << ", element " << i;
  }
}

TEST(Orthogonal, SizeMattersNotAndNothingStaysNothing) {
  const Tensor x = numbers({16, 24}, 5);
  Tensor small = x.clone(), large = x.clone(), nothing = Tensor::zeros({16, 24});
  for (real& v : small.values()) v *= real(0.0078125);
  for (real& v : large.values()) v *= real(65536);
  for (Tensor* t : {&small, &large, &nothing}) orthogonalise(16, 24, t->data());
  for (Dim i = 0; i < x.size(); ++i) ASSERT_NEAR(small.data()[i], large.data()[i], 1e-5);
  for (const real v : nothing.values()) ASSERT_EQ(v, 0);
  Tensor faint = Tensor::full({16, 24}, real(1e-12));  // far below the 1e-7 beside its norm
  orthogonalise(16, 24, faint.data());
  for (const real v : faint.values()) ASSERT_LT(std::abs(v), 0.01);
}

TEST(Schedule, RisesThenFallsAlongACosine) {
  const Schedule s{.peak = 2, .warm_up = 4, .total = 104};
  EXPECT_DOUBLE_EQ(s.at(0), 0.5);
  EXPECT_DOUBLE_EQ(s.at(3), 2);
  EXPECT_DOUBLE_EQ(s.at(4), 2);
  EXPECT_NEAR(s.at(54), 1, 1e-12);
  EXPECT_NEAR(s.at(104), 0, 1e-12);
  EXPECT_NEAR(s.at(1000), 0, 1e-12);
  for (int i = 5; i < 104; ++i) EXPECT_LT(s.at(i), s.at(i - 1));
  const Schedule all_warm_up{.peak = 2, .warm_up = 10, .total = 5};
  EXPECT_DOUBLE_EQ(all_warm_up.at(4), 1);
  EXPECT_DOUBLE_EQ(all_warm_up.at(20), 2);
}

}  // namespace supertac::adam_test
