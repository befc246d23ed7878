// Baselines after Wu 2022 (IROS, TactileSRCNN and TactileSRGAN): a picture from one frame of the array, on
// pairs (supertac-evaluate --write-pairs). Trained and scored here; the product has no use for them.
//
//   generator  frame, bilinear to the picture's size -> Conv3 1-W, ReLU -> B multi-scale blocks -> Conv3 W-1
//   block      a = (Conv3, Conv5)(x) -> 2W;  b = (Conv3, Conv5)(a) -> 4W;  ReLU(x + Conv1(b))
//   critic     Conv3 1-W -> 3 x (x + Conv3(leaky(Conv3(x))), leaky, max pool) -> linear -> one number
//
// Theirs: W = 64, B = 6, batch norm behind the first convolution, and for the GAN a gradient penalty, which
// needs second derivatives. Here the critic's weights are clipped instead (Arjovsky 2017), and there is no
// batch norm.
#include <algorithm>
#include <cmath>

#include "apps/common/command_line/program.h"
#include "apps/common/command_line/version.h"
#include "apps/common/running/measure.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "autograd/adam.h"
#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/max_pool.h"
#include "autograd/ops/shaping.h"
#include "data/plates/truth.h"
#include "data/scores/metrics.h"
#include "data/windows/batching.h"
#include "data/windows/pairs.h"
#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {
namespace {

constexpr double kRate = 1e-4, kAdversarial = 1e-3;  // Wu 2022
constexpr real kClip = 0.01F;                        // Arjovsky 2017
constexpr int kCriticSteps = 2;                      // for each of the generator
constexpr std::size_t kBatch = 32;

ConvLayerOptions same_size(Dim kernel) { return {.kernel = kernel, .stride = 1, .padding = kernel / 2}; }

/// Two convolutions side by side, of 3x3 and 5x5, their outputs one behind the other.
class MultiScale : public Module {
 public:
  MultiScale(Dim in, Dim out, Rng& rng)
      : small_(in, out, same_size(3), rng), large_(in, out, same_size(5), rng) {
    add("small", small_), add("large", large_);
  }
  Variable forward(const Variable& x) const {
    const Variable both[] = {small_.forward(x, kRelu), large_.forward(x, kRelu)};
    return concat(both);
  }

 private:
  Conv2d small_, large_;
};

class Block : public Module {
 public:
  Block(Dim width, Rng& rng)
      : first_(width, width, rng),
        second_(2 * width, 2 * width, rng),
        last_(4 * width, width, same_size(1), rng) {
    Module::add("first", first_), Module::add("second", second_), Module::add("last", last_);
  }
  Variable forward(const Variable& x) const {
    return relu(supertac::add(x, last_.forward(second_.forward(first_.forward(x)))));
  }

 private:
  MultiScale first_, second_;
  Conv2d last_;
};

class Generator : public Module {
 public:
  Generator(Dim width, Dim blocks, Rng& rng)
      : in_(1, width, same_size(3), rng), out_(width, 1, same_size(3), rng) {
    for (Dim i = 0; i < blocks; ++i) blocks_.emplace_back(width, rng);
    add("in", in_);
    for (std::size_t i = 0; i < blocks_.size(); ++i) add("block." + std::to_string(i), blocks_[i]);
    add("out", out_);
  }
  Variable forward(const Tensor& enlarged) const {
    Variable h = in_.forward(Variable(enlarged), kRelu);
    for (const Block& block : blocks_) h = block.forward(h);
    return out_.forward(h);
  }

 private:
  Conv2d in_, out_;
  std::vector<Block> blocks_;
};

class Critic : public Module {
 public:
  Critic(Dim width, Dim size, Rng& rng)
      : in_(1, width, same_size(3), rng), out_((size / 8) * (size / 8) * width, 1, rng) {
    for (int i = 0; i < 6; ++i) convs_.emplace_back(width, width, same_size(3), rng);
    Module::add("in", in_), Module::add("out", out_);
    for (std::size_t i = 0; i < convs_.size(); ++i) Module::add("conv." + std::to_string(i), convs_[i]);
  }
  /// The mean of what it thinks of the pictures.
  Variable forward(const Variable& pictures) const {
    Variable h = in_.forward(pictures);
    for (std::size_t i = 0; i < convs_.size(); i += 2)
      h = max_pool2d(leaky_relu(supertac::add(h, convs_[i + 1].forward(convs_[i].forward(h, kLeakyRelu)))));
    const Dim n = h.shape()[0];
    return scale(sum(out_.forward(reshape(h, {n, h.value().size() / n}))), 1 / static_cast<real>(n));
  }
  void clip() {
    for (const Variable& parameter : values_of(parameters())) {
      Variable handle = parameter;
      for (real& w : handle.mutable_value().values()) w = std::clamp(w, -kClip, kClip);
    }
  }

 private:
  Conv2d in_;
  Linear out_;
  std::vector<Conv2d> convs_;
};

/// Frames enlarged and targets of one batch.
struct Batch {
  Batch(const PairSet& pairs, std::size_t n)
      : frame(pairs.input_size()), enlarged(shape(pairs, n)), truth(shape(pairs, n)) {}
  static Shape shape(const PairSet& p, std::size_t n) {
    return {static_cast<Dim>(n), p.image().height, p.image().width, 1};
  }
  void fill(const PairSet& pairs, std::span<const std::uint32_t> indices) {
    const std::size_t pixels = pairs.image().pixels();
    for (std::size_t n = 0; n < indices.size(); ++n) {
      pairs.input(indices[n], frame);  // not scaled: it lies in [0,1] already
      enlarge(pairs, enlarged.values().subspan(n * pixels, pixels));
      pairs.target(indices[n], truth.values().subspan(n * pixels, pixels));
    }
  }

  std::vector<float> frame;
  Tensor enlarged, truth;

 private:
  // Bilinear, pixel centres aligned, edges held.
  void enlarge(const PairSet& p, std::span<float> out) const {
    const auto place = [](std::size_t i, std::size_t pixels, std::size_t size) {
      const double at = (static_cast<double>(i) + 0.5) / static_cast<double>(pixels) - 0.5;
      return std::clamp(at, 0.0, static_cast<double>(size - 1));
    };
    const auto scale = static_cast<std::size_t>(p.scale());
    const auto height = static_cast<std::size_t>(p.array().rows);
    const auto width = static_cast<std::size_t>(p.array().columns);
    for (std::size_t i = 0; i < height * scale; ++i) {
      const double y = place(i, scale, height);
      const auto y0 = static_cast<std::size_t>(y), y1 = std::min(y0 + 1, height - 1);
      for (std::size_t j = 0; j < width * scale; ++j) {
        const double x = place(j, scale, width);
        const auto x0 = static_cast<std::size_t>(x), x1 = std::min(x0 + 1, width - 1);
        const auto row = [&](std::size_t r) {
          const double left = frame[r * width + x0], right = frame[r * width + x1];
          return left + (x - static_cast<double>(x0)) * (right - left);
        };
        const double above = row(y0), below = row(y1);
        out[i * width * scale + j] =
            static_cast<float>(above + (y - static_cast<double>(y0)) * (below - above));
      }
    }
  }
};

void train(Generator& generator, Critic* critic, const PairSet& pairs, std::uint64_t seed,
           std::int64_t epochs, Progress& progress) {
  std::vector<std::uint32_t> all(pairs.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint32_t>(i);
  const Batching batching(std::move(all), kBatch, seed);
  Adam adam(values_of(generator.parameters()), {.learning_rate = kRate});
  std::unique_ptr<Adam> critics;
  if (critic != nullptr)
    critics = std::make_unique<Adam>(values_of(critic->parameters()), AdamOptions{.learning_rate = kRate});
  Batch batch(pairs, batching.batch_size());
  std::vector<std::uint32_t> indices(batching.batch_size());
  const auto per_epoch = static_cast<std::int64_t>(batching.batches_per_epoch());
  for (std::int64_t step = 0; step < epochs * per_epoch; ++step) {
    stop_if_interrupted();
    batching.batch(static_cast<std::uint64_t>(step / per_epoch), static_cast<std::uint64_t>(step % per_epoch),
                   indices);
    batch.fill(pairs, indices);
    for (int i = 0; critic != nullptr && i < kCriticSteps; ++i) {
      critics->zero_grad();
      const Variable drawn(generator.forward(batch.enlarged).value());  // a leaf: the generator stands still
      backward(add(critic->forward(drawn), scale(critic->forward(Variable(batch.truth)), -1)));
      critics->step();
      critic->clip();
    }
    adam.zero_grad();
    const Variable drawn = generator.forward(batch.enlarged);
    Variable loss = l2_loss(drawn, Variable(batch.truth));
    if (critic != nullptr) loss = add(loss, scale(critic->forward(drawn), -static_cast<real>(kAdversarial)));
    backward(loss);
    adam.step();
    progress.update(static_cast<std::size_t>(step) + 1);
  }
}

nlohmann::ordered_json score(const Generator& generator, const PairSet& pairs) {
  const NoGrad no_grad;
  const ImageGrid image = pairs.image();
  PairMetrics contact(static_cast<std::size_t>(image.height), static_cast<std::size_t>(image.width));
  PairMetrics all = contact;
  Batch batch(pairs, 1);
  for (std::uint32_t i = 0; i < pairs.size(); ++i) {
    batch.fill(pairs, {&i, 1});
    const Variable drawn = generator.forward(batch.enlarged);
    all.add(drawn.value().values(), batch.truth.values());
    if (in_contact(batch.truth.values())) contact.add(drawn.value().values(), batch.truth.values());
  }
  const Latency latency = measure_latency([&] { generator.forward(batch.enlarged); });
  return {{"contact", to_json(contact.result())},
          {"all", to_json(all.result())},
          {"latency", {{"network", latency.to_json()}}}};
}

void declare(Arguments& a) {
  a.required("train", "FILE", "pairs of one channel");
  a.required("test", "FILE", "pairs");
  a.option("method", "NAME", "srcnn or srgan", "srcnn");
  a.option("width", "W", "channels; Wu 2022 has 64, 16 times the cost of 16", "16");
  a.option("blocks", "B", "multi-scale blocks; Wu 2022 has 6", "3");
  a.option("epochs", "N", "passes over the pairs; Wu 2022 has 300 over far fewer", "10");
  a.option("seed", "N", "of weights and order", "0");
}

int run(Arguments& a) {
  const PairSet pairs = PairSet::read(a.text("train")), test = PairSet::read(a.text("test"));
  const auto seed = static_cast<std::uint64_t>(a.integer("seed", 0, 1 << 30));
  const std::int64_t epochs = a.integer("epochs", 1, 10'000);
  const Dim width = a.integer("width", 1, 256);
  const ImageGrid image = pairs.image();
  if (pairs.array().channels != 1 || image.height != image.width || image.height < 8)
    throw std::runtime_error(a.text("train") +
                             ": expected pairs of one channel with square targets of 8 pixels or more");
  Rng rng(seed);
  Generator generator(width, a.integer("blocks", 1, 64), rng);
  std::unique_ptr<Critic> critic;
  if (a.choice("method", {"srcnn", "srgan"}) == "srgan")
    critic = std::make_unique<Critic>(width, image.height, rng);
  Progress progress(a, "training", static_cast<std::size_t>(epochs) * (pairs.size() / kBatch), "steps");
  train(generator, critic.get(), pairs, seed, epochs, progress);
  nlohmann::ordered_json result = {{"command", a.command_line()}, {"commit", commit()}};
  result.update(score(generator, test));
  a.print(result.dump(2));
  a.write_json(result);
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"wu_upsamplers", "Trains and scores single-frame upsamplers after Wu 2022.",
                                  supertac::declare, supertac::run};
  return supertac::run_program(program, argc, argv);
}
