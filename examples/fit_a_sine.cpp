// Fits y = sin(x) with two linear layers: tensors, layers, backward and Adam on one screen.
// It prints the loss while it falls: to .0001 in 2,000 steps, which take 0.1 s on one thread.
#include <cmath>
#include <cstdio>
#include <numbers>

#include <supertac/autograd/ops/losses.h>
#include <supertac/autograd/optimisers/adam.h>
#include <supertac/layers/linear.h>
#include <supertac/models/training/loss/schedule.h>

using namespace supertac;

namespace {

// A network is a value made of layers; add() gives its parameters their names.
class Network : public Module {
 public:
  explicit Network(Rng& rng) : hidden_(1, kHidden, rng), out_(kHidden, 1, rng) {
    add("hidden", hidden_);
    add("out", out_);
  }
  // x [N,1] -> [N,1]
  Variable forward(const Variable& x) const { return out_.forward(hidden_.forward(x, kLeakyRelu)); }

 private:
  static constexpr Dim kHidden = 64;
  Linear hidden_, out_;
};

}  // namespace

int main() {
  constexpr Dim kPoints = 256;
  constexpr int kSteps = 2000;
  Tensor x(Shape{kPoints, 1}), y(Shape{kPoints, 1});
  for (Dim i = 0; i < kPoints; ++i) {
    const double angle = std::numbers::pi * (2.0 * static_cast<double>(i) / (kPoints - 1) - 1);
    x.data()[i] = static_cast<real>(angle);
    y.data()[i] = static_cast<real>(std::sin(angle));
  }

  Rng rng(0);
  const Network network(rng);
  Adam adam(values_of(network.parameters()), {.learning_rate = 1e-2});
  const Schedule schedule{.peak = 1e-2, .warm_up = 50, .total = kSteps};
  for (int step = 0; step <= kSteps; ++step) {
    const Variable loss = l2_loss(network.forward(Variable(x)), Variable(y));
    if (step % 500 == 0) std::printf("step %4d  loss %.6f\n", step, loss.item());
    adam.zero_grad();
    backward(loss);  // every parameter's grad() is there now, and the graph is gone
    adam.set_learning_rate(schedule.at(step));
    adam.step();
  }

  const NoGrad only_values;
  const Variable at = network.forward(Variable(Tensor::of({2, 1}, {real(0.5), real(-2)})));
  std::printf("sin(0.5) = %.3f, network %.3f;  sin(-2) = %.3f, network %.3f\n", std::sin(0.5),
              at.value().data()[0], std::sin(-2.0), at.value().data()[1]);
}
