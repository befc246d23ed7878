// The inputs of every op one by one, and errors planted in each; `supertac-check gradients` compares all of
// apps/check/gradient_cases.cpp with finite differences.

#include "apps/check/gradient_cases.h"
#include "autograd/gradient_checker.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/trace.h"
#include "tests/support/test.h"

namespace supertac::gradient_test {

TEST(OpGradients, AnInputHasTheSameOneWhereAllOthersAreConstants) {
  for (const GradientCase& c : op_cases()) {
    std::vector<Variable> all;
    for (const Variable& leaf : c.leaves) all.emplace_back(leaf.value(), true);
    backward(sum(c.f(all)));
    for (std::size_t i = 0; i < all.size(); ++i) {
      std::vector<Variable> one;
      for (std::size_t k = 0; k < all.size(); ++k) one.emplace_back(all[k].value(), k == i);
      backward(sum(c.f(one)));
      EXPECT_TRUE(std::ranges::equal(one[i].grad().values(), all[i].grad().values())) << c.options.names[i];
    }
  }
}

// Of no rows, or of an empty Variable. Weights and biases keep their sizes.
TEST(OpGradients, OfNoRowsAreEmptyOrAllZero) {
  std::set<std::string> refused;
  for (const GradientCase& c : op_cases()) {
    std::vector<Variable> leaves;
    for (std::size_t i = 0; i < c.leaves.size(); ++i) {
      const std::span<const Dim> dims = c.leaves[i].shape().dims();
      std::vector<Dim> none(dims.begin(), dims.end());
      if (!c.is_weight[i]) none[0] = 0;
      leaves.emplace_back(Tensor::zeros(Shape(none)), true);
    }
    try {
      backward(sum(c.f(leaves)));
    } catch (const std::invalid_argument& error) {  // a mean of nothing, or a constant of other rows
      const std::string said = error.what();
      EXPECT_TRUE(said.starts_with(c.name + ": ") && said.find(" expects ") != std::string::npos &&
                  said.find(", got ") != std::string::npos)
          << said;
      refused.insert(c.name);
      continue;
    }
    for (const Variable& leaf : leaves) {
      ASSERT_EQ(leaf.grad().shape(), leaf.shape()) << c.name;
      for (const real g : leaf.grad().values()) ASSERT_EQ(g, 0) << c.name;
    }
  }
  EXPECT_EQ(refused, (std::set<std::string>{"kl_divergence", "l2_loss", "sample_gaussian",
                                            "softmax_cross_entropy", "ssim"}));
}

TEST(OpGradients, AnEmptyVariableIsRefusedByName) {
  for (const GradientCase& c : op_cases())
    for (std::size_t i = 0; i < c.leaves.size(); ++i) {
      std::vector<Variable> leaves = c.leaves;
      leaves[i] = Variable();
      const std::string said = what_of<std::invalid_argument>([&] { c.f(leaves); });
      EXPECT_TRUE(said.starts_with(c.name + ": ")) << said;
      EXPECT_TRUE(said.ends_with(" expects a value, got an empty Variable"))
          << c.options.names[i] << ", " << said;
    }
}

// Spoils what the reverse step of an op adds to the gradient of one input.
struct Planted : ReverseWatch {
  enum Kind { sign, twice, index };
  std::string op;
  std::size_t input = 0;
  Kind kind = sign;

  void reverse(Backward& b, const std::function<void()>& step) override {
    const bool is_it = b.node().op == op && input < b.node().input_count;
    const Slot gradient = is_it ? b.slot_of(input) : Slot{};
    if (!gradient) return step();
    const auto size = static_cast<std::size_t>(b.value(input).size());
    gradient.begin(b.value(input).size());
    const std::vector<real> before(gradient.data, gradient.data + size);
    step();
    std::vector<real> added(gradient.data, gradient.data + size);
    for (std::size_t i = 0; i < size; ++i) added[i] -= before[i];
    if (kind == index && !added.empty()) std::rotate(added.begin(), added.end() - 1, added.end());
    for (std::size_t i = 0; i < size; ++i)
      gradient.data[i] = before[i] + added[i] * (kind == sign ? -1 : kind == twice ? 2 : 1);
  }
};

TEST(OpGradients, APlantedErrorIsFoundAndNamed) {
  std::string last;
  for (const GradientCase& c : op_cases()) {
    // One case of each op, of more than one number: a single one has no other index.
    if (c.leaves[0].size() == 1 || std::exchange(last, c.name) == c.name) continue;
    for (std::size_t input = 0; input < c.leaves.size(); ++input) {
      for (const Planted::Kind kind : {Planted::sign, Planted::twice, Planted::index}) {
        if (kind == Planted::index && c.name == "sum") continue;  // the same number at every index
        Planted plant;
        plant.op = c.name, plant.input = input, plant.kind = kind;
        const GradientReport report = c.check();
        EXPECT_GT(report.wrong, 0) << c.options.names[input] << ", " << kind;
        EXPECT_TRUE(report.worst.front().place.starts_with(c.options.names[input])) << report.text();
      }
    }
  }
}

}  // namespace supertac::gradient_test
