// A small SuperTac in double precision: windows of 16 samples of 4 taxels, one VAE, pictures of 8x8 pixels.
#include <cmath>
#include <memory>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/linear.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"
#include "autograd/optimisers/adam.h"
#include "docs/lessons/check/check.h"
#include "io/numbers/random.h"

namespace lessons {
namespace {

using supertac::Backward;
using supertac::Dim;
using supertac::Shape;

constexpr Dim kImages = 8, kSamples = 16, kTaxels = 4, kLatent = 3, kMaps = 6, kSide = 8, kChannels = 2;

std::size_t size(Dim n) { return static_cast<std::size_t>(n); }
/// Image n of a batch; of an array without one, all of it.
Array part(const Tensor& t, Dim n, Dim of) {
  const Dim each = t.size() / of;
  return {t.data() + n * each, t.data() + (n + 1) * each};
}
Array all(const Tensor& t) { return part(t, 0, 1); }
void put(const Array& from, Tensor& to, Dim n) {
  std::copy(from.begin(), from.end(), to.data() + n * static_cast<Dim>(from.size()));
}
void add_to(Tensor* to, const Array& from, Dim n = 0) {
  if (to == nullptr) return;
  for (std::size_t i = 0; i < from.size(); ++i) to->data()[size(n) * from.size() + i] += from[i];
}

Line line_of(const Variable& x, const Variable& w) {
  return {size(x.dim(1)), size(x.dim(2)), size(w.dim(2)), size(w.dim(0)), 2, 1};
}

}  // namespace

Variable Ops::linear(const Variable& x, const Variable& w, const Variable& bias) const {
  if (!yours[2]) return supertac::linear(x, w, bias);
  const Table s{size(x.dim(0)), size(x.dim(1)), size(w.dim(1))};
  Tensor y(Shape{x.dim(0), w.dim(1)});
  Array out(s.rows * s.out);
  lessons::linear(s, all(x.value()), all(w.value()), all(bias.value()), out);
  put(out, y, 0);
  return supertac::record("your linear", y, {&x, &w, &bias}, [s](Backward& b) {
    Array gx(s.rows * s.in), gw(s.in * s.out), gbias(s.out);
    linear_gradient(s, all(b.value(0)), all(b.value(1)), all(b.gy()), gx, gw, gbias);
    add_to(b.grad_of(0), gx), add_to(b.grad_of(1), gw), add_to(b.grad_of(2), gbias);
  });
}

Variable Ops::conv(const Variable& x, const Variable& w, const Variable& bias) const {
  if (!yours[3]) return supertac::conv1d(x, w, bias, {.stride = 2, .padding = 1});
  const Line s = line_of(x, w);
  const Dim images = x.dim(0);
  Tensor y(Shape{images, static_cast<Dim>(s.out_length()), w.dim(2)});
  for (Dim n = 0; n < images; ++n) {
    Array out(s.out_length() * s.out);
    lessons::conv(s, part(x.value(), n, images), all(w.value()), all(bias.value()), out);
    put(out, y, n);
  }
  return supertac::record("your conv", y, {&x, &w, &bias}, [s, images](Backward& b) {
    for (Dim n = 0; n < images; ++n) {
      Array gx(s.length * s.in), gw(s.kernel * s.in * s.out), gbias(s.out);
      conv_gradient(s, part(b.value(0), n, images), all(b.value(1)), part(b.gy(), n, images), gx, gw, gbias);
      add_to(b.grad_of(0), gx, n), add_to(b.grad_of(1), gw), add_to(b.grad_of(2), gbias);
    }
  });
}

// Its value is the reader's; the way back is a convolution, which the project has tested.
Variable Ops::conv_transpose(const Variable& z, const Variable& w, const Variable& bias) const {
  const supertac::ConvOptions options{.stride = 2, .padding = 1};
  const Variable ours = supertac::conv_transpose1d(z, w, bias, options);
  if (!yours[3]) return ours;
  Tensor difference = ours.value().clone();
  const Line s = line_of(z, w);
  for (Dim n = 0; n < z.dim(0); ++n) {
    Array out(s.transposed_length() * s.out);
    lessons::conv_transpose(s, part(z.value(), n, z.dim(0)), all(w.value()), all(bias.value()), out);
    for (std::size_t i = 0; i < out.size(); ++i) {
      double& d = difference.data()[size(n) * out.size() + i];
      d = out[i] - d;
    }
  }
  return ours + Variable(difference);
}

Variable Ops::channel_mean(const Variable& x) const {
  if (!yours[4]) return supertac::global_mean(x);
  const Image s{size(x.dim(1) * x.dim(2)), size(x.dim(3))};
  const Dim images = x.dim(0);
  Tensor y(Shape{images, x.dim(3)});
  for (Dim n = 0; n < images; ++n) {
    Array mean(s.channels);
    lessons::channel_mean(s, part(x.value(), n, images), mean);
    put(mean, y, n);
  }
  return supertac::record("your mean", y, {&x}, [s, images](Backward& b) {
    for (Dim n = 0; n < images; ++n) {
      Array gx(s.pixels * s.channels);
      channel_mean_gradient(s, part(b.gy(), n, images), gx);
      add_to(b.grad_of(0), gx, n);
    }
  });
}

Variable Ops::gated_sum(const Variable& a, const Variable& x, const Variable& gate) const {
  if (!yours[4]) return supertac::gated_sum(a, x, gate);
  const Image s{size(x.dim(1) * x.dim(2)), size(x.dim(3))};
  const Dim images = x.dim(0);
  Tensor y(x.shape());
  for (Dim n = 0; n < images; ++n) {
    Array out(s.pixels * s.channels);
    lessons::gated_sum(s, part(a.value(), n, images), part(x.value(), n, images),
                       part(gate.value(), n, images), out);
    put(out, y, n);
  }
  return supertac::record("your gated sum", y, {&a, &x, &gate}, [s, images](Backward& b) {
    for (Dim n = 0; n < images; ++n) {
      Array ga(s.pixels * s.channels), gx(ga.size()), ggate(s.channels);
      gated_sum_gradient(s, part(b.value(1), n, images), part(b.value(2), n, images), part(b.gy(), n, images),
                         ga, gx, ggate);
      add_to(b.grad_of(0), ga, n), add_to(b.grad_of(1), gx, n), add_to(b.grad_of(2), ggate, n);
    }
  });
}

Variable Ops::sample(const Variable& mean, const Variable& log_var, const Tensor& eps) const {
  if (!yours[5]) return supertac::sample_gaussian(mean, log_var, eps);
  Tensor z(mean.shape());
  Array out(size(z.size()));
  lessons::sample(all(mean.value()), all(log_var.value()), all(eps), out);
  put(out, z, 0);
  return supertac::record("your sample", z, {&mean, &log_var}, [eps](Backward& b) {
    Array gmean(size(eps.size())), glog_var(gmean.size());
    sample_gradient(all(b.value(1)), all(eps), all(b.gy()), gmean, glog_var);
    add_to(b.grad_of(0), gmean), add_to(b.grad_of(1), glog_var);
  });
}

Variable Ops::divergence(const Variable& mean, const Variable& log_var) const {
  if (!yours[5]) return supertac::kl_divergence(mean, log_var);
  const double rows = static_cast<double>(mean.dim(0));
  const double value = lessons::divergence(all(mean.value()), all(log_var.value())) / rows;
  return supertac::record("your divergence", Tensor::full({}, value), {&mean, &log_var}, [rows](Backward& b) {
    Array gmean(size(b.value(0).size())), glog_var(gmean.size());
    divergence_gradient(all(b.value(0)), all(b.value(1)), b.gy().item() / rows, gmean, glog_var);
    add_to(b.grad_of(0), gmean), add_to(b.grad_of(1), glog_var);
  });
}

Variable Ops::ssim(const Variable& x, const Tensor& truth) const {
  if (!yours[6]) return supertac::ssim(x, truth);
  const Dim images = x.dim(0);
  const std::size_t side = size(x.dim(1));
  double value = 0;
  for (Dim n = 0; n < images; ++n)
    value += lessons::ssim(side, part(x.value(), n, images), part(truth, n, images));
  value /= static_cast<double>(images);
  return supertac::record("your ssim", Tensor::full({}, value), {&x}, [=](Backward& b) {
    for (Dim n = 0; n < images; ++n) {
      Array gx(side * side);
      ssim_gradient(side, part(b.value(0), n, images), part(truth, n, images),
                    b.gy().item() / static_cast<double>(images), gx);
      add_to(b.grad_of(0), gx, n);
    }
  });
}

namespace {

/// Weights and biases in the order in which they are first asked for.
class Parameters {
 public:
  Variable next(const Shape& shape) {
    if (at_ == values_.size()) {
      Tensor t(shape);
      for (double& x : t.values()) x = shape.dims().size() == 1 ? 0 : 0.3 * random_.normal(counter_++);
      values_.emplace_back(t, true);
    }
    return values_[at_++];
  }
  std::vector<Variable>& from_start() { return at_ = 0, values_; }

 private:
  supertac::RandomStream random_{5, 0};
  std::uint64_t counter_ = 0;
  std::size_t at_ = 0;
  std::vector<Variable> values_;
};

struct Batch {
  Tensor windows{Shape{kImages, kSamples, kTaxels}}, truth{Shape{kImages, kSide, kSide, 1}};
};

// A ridge that slides under four taxels in a row.
Batch ridges() {
  Batch batch;
  for (Dim n = 0; n < kImages; ++n) {
    const double phase = 0.8 * static_cast<double>(n);
    for (Dim i = 0; i < kSamples * kTaxels; ++i)
      batch.windows.data()[n * kSamples * kTaxels + i] =
          0.5 +
          0.5 * std::sin(phase + 0.5 * static_cast<double>(i / kTaxels) - static_cast<double>(i % kTaxels));
    for (Dim i = 0; i < kSide * kSide; ++i)
      batch.truth.data()[n * kSide * kSide + i] =
          0.5 + 0.5 * std::sin(phase - static_cast<double>(i / kSide));
  }
  return batch;
}

Variable loss_of(const Ops& ops, Parameters& p, const Batch& batch, const Tensor& eps) {
  p.from_start();
  const auto dense = [&](const Variable& x, Dim out) {
    const Variable w = p.next({x.dim(1), out});
    return ops.linear(x, w, p.next({out}));
  };
  const Variable x(batch.windows), filters = p.next({3, kTaxels, kMaps});
  const Variable maps = supertac::leaky_relu(ops.conv(x, filters, p.next({kMaps})));
  const Variable flat = supertac::reshape(maps, {kImages, kSamples / 2 * kMaps});
  const Variable mean = dense(flat, kLatent), log_var = supertac::clamp(dense(flat, kLatent), -10, 10);
  const Variable z = ops.sample(mean, log_var, eps);
  const Variable coarse =
      supertac::reshape(supertac::leaky_relu(dense(z, kSamples / 2 * kMaps)), {kImages, kSamples / 2, kMaps});
  const Variable widen = p.next({4, kMaps, kTaxels});
  const Variable decoded = supertac::sigmoid(ops.conv_transpose(coarse, widen, p.next({kTaxels})));
  const Variable image = supertac::reshape(supertac::leaky_relu(dense(z, kSide * kSide * kChannels)),
                                           {kImages, kSide, kSide, kChannels});
  const Variable gates = supertac::sigmoid(dense(ops.channel_mean(image), kChannels));
  const Variable attended = ops.gated_sum(image, image, gates);
  const Variable pixels = dense(supertac::reshape(attended, {kImages * kSide * kSide, kChannels}), 1);
  const Variable picture = supertac::reshape(pixels, {kImages, kSide, kSide, 1});
  const Variable seen = supertac::l2_loss(decoded, x) + 1e-3 * ops.divergence(mean, log_var);
  const Variable drawn =
      supertac::l2_loss(picture, Variable(batch.truth)) - 0.1 * ops.ssim(picture, batch.truth);
  return seen + drawn;
}

}  // namespace

Losses train_whole(const Ops& ops) {
  constexpr int kSteps = 60;
  constexpr Rates kRates{.rate = 1e-2};
  const Batch batch = ridges();
  const supertac::RandomStream random(9, 1);
  Parameters parameters;
  std::vector<Array> m, v;
  std::unique_ptr<supertac::Adam> adam;
  Losses losses{};
  for (int step = 1; step <= kSteps; ++step) {
    Tensor eps(Shape{kImages, kLatent});
    for (Dim i = 0; i < eps.size(); ++i)
      eps.data()[i] = random.normal(static_cast<std::uint64_t>(step * 100 + i));
    const Variable loss = loss_of(ops, parameters, batch, eps);
    (step == 1 ? losses.first : losses.last) = loss.item();
    std::vector<Variable>& values = parameters.from_start();
    if (!adam)
      adam = std::make_unique<supertac::Adam>(values, supertac::AdamOptions{.learning_rate = kRates.rate});
    m.resize(values.size()), v.resize(values.size());
    adam->zero_grad();
    supertac::backward(loss);
    if (!ops.yours[7]) {
      adam->step();
      continue;
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      Array x = all(values[i].value());
      m[i].resize(x.size()), v[i].resize(x.size());
      adam_step(kRates, step, all(values[i].grad()), m[i], v[i], x);
      put(x, values[i].mutable_value(), 0);
    }
  }
  return losses;
}

}  // namespace lessons
