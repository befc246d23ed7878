#include "autograd/gradient_checker.h"

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/elementwise.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::gradient_checker_test {

/// Of a function of inputs; its leaves are copies.
GradientReport checked(const std::function<Variable(const std::vector<Variable>&)>& f,
                       const std::vector<Tensor>& inputs, const GradientCheckOptions& options = {}) {
  std::vector<Variable> leaves;
  for (const Tensor& t : inputs) leaves.emplace_back(t.clone(), true);
  return check_gradients([&] { return f(leaves); }, leaves, options);
}

// y = a b + a with a planted error in the gradient of a: ga = gy (by_b * b + by_one).
Variable planted(const std::vector<Variable>& in, real by_b, real by_one) {
  const Tensor y = (in[0] * in[1] + in[0]).value();
  return record("planted", y, {&in[0], &in[1]}, [=](Backward& g) {
    const real *gy = g.gy().data(), *a = g.value(0).data(), *b = g.value(1).data();
    add_to_gradient(g, 0, [=](Dim i) { return gy[i] * (by_b * b[i] + by_one); });
    add_to_gradient(g, 1, [=](Dim i) { return gy[i] * a[i]; });
  });
}

GradientReport check_planted(real by_b, real by_one) {
  return checked([=](const auto& in) { return planted(in, by_b, by_one); },
                 {test::numbers({3, 4}), test::numbers({3, 4}, 2)});
}

#ifdef SUPERTAC_REAL_IS_DOUBLE
TEST(GradientChecker, PassesTheRightGradient) {
  const GradientReport report = check_planted(1, 1);
  EXPECT_LT(report.max_relative_error, 1e-9) << report.text();
  EXPECT_EQ(report.entries, 24);
  EXPECT_EQ(report.worst.size(), 10U);
}

TEST(GradientChecker, FindsAnErrorOfAMillionth) {
  EXPECT_GT(check_planted(1, 1.00001).max_relative_error, 1e-6);
}
#endif

TEST(GradientChecker, FailsOnPlantedErrors) {
  const struct {
    const char* name;
    real by_b, by_one;
  } errors[] = {{"sign", -1, -1}, {"factor 2", 2, 2}, {"missing term", 1, 0}, {"zero", 0, 0}};
  for (const auto& e : errors) {
    const GradientReport report = check_planted(e.by_b, e.by_one);
    EXPECT_GT(report.max_relative_error, 0.1) << e.name;
    ASSERT_FALSE(report.worst.empty());
    EXPECT_EQ(report.worst[0].input, 0U) << e.name << ": the report names the wrong input\n" << report.text();
    const auto says = [&](const char* pattern) { return report.text().find(pattern) != std::string::npos; };
    if (sizeof(real) == 8) {
      EXPECT_EQ(says(", analytic = -1 numeric in each\n"), e.by_one == -1) << report.text();
      EXPECT_EQ(says(", analytic = 2 numeric in each\n"), e.by_one == 2) << report.text();
      EXPECT_EQ(says(", analytic = 0 numeric in each\n"), e.by_b == 0) << report.text();
    }
  }
}

TEST(GradientChecker, FailsOnOneWrongElement) {
  const auto f = [](const std::vector<Variable>& in) {
    return record("planted", in[0].value().clone(), {&in[0]}, [](Backward& b) {
      add_to_gradient(b, 0, [gy = b.gy().data()](Dim i) { return gy[i] * (i == 7 ? -1 : 1); });
    });
  };
  const GradientReport report = checked(f, {test::numbers({3, 4})});
  EXPECT_EQ(report.worst[0].index, 7);
  EXPECT_GT(report.max_relative_error, 0.1);
  EXPECT_EQ(report.text().find("input 0 [1,3] of [3,4]: analytic "), report.text().find('\n') + 1)
      << report.text();
  if (sizeof(real) == 8) {
    EXPECT_TRUE(report.text().starts_with(
        "1 of 12 entries (of 12 elements) off by more than 1e-06, analytic = -1 numeric in each\n"))
        << report.text();
    const std::string text = report.text(), second = text.substr(text.find("input 0 [1,3]"));
    EXPECT_FALSE(second.substr(0, second.find('\n')).ends_with(" (right)")) << text;
    EXPECT_TRUE(text.ends_with(" (right)\n")) << text;
  }
  EXPECT_EQ(checked(f, {test::numbers({3, 4})}, {.names = {"mean"}}).worst[0].place, "mean [1,3] of [3,4]");
  EXPECT_EQ(checked(f, {test::numbers({12})}).worst[0].place, "input 0 [7] of [12]");
  EXPECT_EQ(checked(f, {test::numbers({2, 2, 3, 1})}).worst[0].place, "input 0 [1,0,1,0] of [2,2,3,1]");
}

TEST(GradientChecker, FailsOnNotANumber) {
  const auto f = [](const std::vector<Variable>& in) {
    return record("planted", in[0].value().clone(), {&in[0]}, [](Backward& b) {
      add_to_gradient(b, 0, [](Dim) { return std::numeric_limits<real>::quiet_NaN(); });
    });
  };
  EXPECT_GT(checked(f, {test::numbers({2})}).max_relative_error, 1e6);
}

TEST(GradientChecker, FailsWhenNoGradientArrives) {
  const auto cut = [](const std::vector<Variable>& in) {
    return Variable((2 * in[0]).value()) + 1 * in[1];  // in[0] is cut off from the graph
  };
  EXPECT_GT(checked(cut, {test::numbers({2}), test::numbers({2})}).max_relative_error, 0.1);
}

TEST(GradientChecker, PutsALeafBackWhenTheFunctionThrows) {
  const Variable x(test::numbers({3}), true);
  const Tensor before = x.value().clone();
  int calls = 0;
  EXPECT_EQ(what_of<std::runtime_error>([&] {
              check_gradients(
                  [&] {
                    if (++calls == 3) throw std::runtime_error("of f");
                    return x * x;
                  },
                  {x});
            }),
            "of f");
  EXPECT_TRUE(test::same_bytes(x.value(), before));
}

TEST(GradientChecker, OfEmptyInputsNothingIsCompared) {
  const auto report = checked([](const auto& in) { return 2 * in[0]; }, {Tensor::zeros({0, 3})});
  EXPECT_EQ(report.entries, 0);
  EXPECT_EQ(report.max_relative_error, 0);
  EXPECT_EQ(report.text(), "no entries: the inputs are empty\n");
}

}  // namespace supertac::gradient_checker_test
