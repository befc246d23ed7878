#include "apps/check/gradient_cases.h"

#include <algorithm>
#include <array>
#include <optional>

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/linear.h"
#include "autograd/ops/losses.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"
#include "autograd/record.h"
#include "layers/residual.h"
#include "models/networks/classifier.h"
#include "models/training/loss/loss.h"

namespace supertac {
namespace {

Tensor uniform(const Shape& shape, std::uint64_t stream, double low = -1, double high = 1) {
  Tensor t(shape);
  const RandomStream random(19, stream);
  std::uint64_t i = 0;
  for (real& x : t.values()) x = static_cast<real>(low + (high - low) * random.uniform(i++));
  return t;
}

// At least 0.1 from zero, where rectifiers have no derivative.
Tensor off_zero(const Shape& shape) {
  Tensor t = uniform(shape, 1);
  for (real& x : t.values()) x += static_cast<real>(x < 0 ? -0.1 : 0.1);
  return t;
}

using Leaves = std::vector<Variable>;
using F = std::function<Variable(const Leaves&)>;

class Cases {
 public:
  explicit Cases(std::string kind) : kind_(std::move(kind)) {}

  // `settings`: of the op, for the names of what is wrong: "conv2d weight (stride 2, padding 1)".
  void op(const std::string& name, const std::vector<std::string>& inputs, const std::vector<Tensor>& values,
          const F& f, GradientCheckOptions options = {}, const std::string& settings = {}) {
    Leaves leaves;
    for (const Tensor& t : values) leaves.emplace_back(t, true);
    std::vector<bool> is_weight;
    for (const std::string& input : inputs) is_weight.push_back(input == "weight" || input == "bias");
    options.names = inputs;
    for (std::string& input : options.names)
      input = name + " " + input + (settings.empty() ? "" : " (" + settings + ")");
    cases_.push_back({kind_, name, f, leaves, std::move(options), is_weight});
  }

  // f of x, or of nothing: the gradients of the parameters, and of x.
  void module(const std::string& name, const std::vector<Parameter>& parameters,
              const std::optional<Tensor>& x, const std::function<Variable(const Variable&)>& f, Dim most) {
    Leaves leaves = values_of(parameters);
    GradientCheckOptions options{.max_entries_per_input = most};
    for (const Parameter& parameter : parameters) options.names.push_back(parameter.name);
    const Variable input = x ? Variable(*x, true) : Variable();
    if (x) leaves.push_back(input), options.names.push_back("x");
    for (std::string& leaf : options.names) leaf = name + " " + leaf;
    cases_.push_back({kind_, name, [=](const Leaves&) { return f(input); }, leaves, std::move(options), {}});
  }

  template <class M>
  void layer(const std::string& name, const M& m, const Shape& x, Dim most = 200) {
    module(
        name, m.parameters(), uniform(x, 2), [m](const Variable& input) { return m.forward(input); }, most);
  }

  std::vector<GradientCase> take() { return std::move(cases_); }

 private:
  std::string kind_;
  std::vector<GradientCase> cases_;
};

void elementwise(Cases& cases) {
  const std::pair<const char*, F> ops[] = {
      {"relu", [](const Leaves& in) { return relu(in[0]); }},
      {"leaky_relu", [](const Leaves& in) { return leaky_relu(in[0]); }},
      {"sigmoid", [](const Leaves& in) { return sigmoid(in[0]); }},
      {"clamp", [](const Leaves& in) { return clamp(in[0], real(-0.51), real(0.72)); }}};
  for (const auto& [name, f] : ops)
    for (const Shape& shape : {Shape{2, 5, 3, 17}, Shape{33}, Shape{1, 1}})
      cases.op(name, {"x"}, {off_zero(shape)}, f);
  const std::vector<Tensor> two{uniform({3, 5, 2}, 1), uniform({3, 5, 2}, 2)};
  cases.op("add", {"a", "b"}, two, [](const Leaves& in) { return in[0] + in[1]; });
  cases.op("multiply", {"a", "b"}, two, [](const Leaves& in) { return in[0] * in[1]; });
  cases.op("scale", {"x"}, {uniform({17}, 1)}, [](const Leaves& in) { return -3 * in[0]; });
  cases.op("sum", {"x"}, {uniform({3, 7}, 1)}, [](const Leaves& in) { return sum(in[0]); });
}

// Channels around the lengths of vectors.
constexpr Dim kChannels[] = {1, 3, 17, 33};

void attention(Cases& cases) {
  for (const Dim channels : kChannels)
    cases.op("global_mean", {"x"}, {uniform({2, 3, 5, channels}, 1)},
             [](const Leaves& in) { return global_mean(in[0]); });
  for (const Dim channels : kChannels)
    cases.op("gated_sum", {"a", "x", "s"},
             {uniform({2, 3, 5, channels}, 3), uniform({2, 3, 5, channels}, 1), uniform({2, channels}, 2)},
             [](const Leaves& in) { return gated_sum(in[0], in[1], in[2]); });
}

std::string activation_text(real negative_slope) {
  return negative_slope == kNoActivation ? "no activation" : "negative_slope " + digits(negative_slope);
}

using Convolve = Variable (*)(const Variable&, const Variable&, const Variable&, const ConvOptions&);

void convolution(Cases& cases, const std::string& name, Convolve op, const Shape& x, const Shape& w,
                 const ConvOptions& options, Dim most = 60) {
  cases.op(
      name, {"x", "weight", "bias"}, {uniform(x, 1), uniform(w, 2), uniform({w[w.rank() - 1]}, 3)},
      [=](const Leaves& in) { return op(in[0], in[1], in[2], options); }, {.max_entries_per_input = most},
      "stride " + std::to_string(options.stride) + ", padding " + std::to_string(options.padding) + ", " +
          activation_text(options.negative_slope));
}

// H != W, strides 2 and 3, no padding and much, a single pixel, channels around the lengths of vectors.
struct MapCase {
  Dim images, height, width, in, out, kernel, stride, padding;
};
constexpr MapCase kMaps[] = {
    {2, 5, 7, 3, 17, 3, 1, 1}, {1, 6, 4, 1, 1, 3, 2, 1},   {2, 7, 5, 17, 3, 3, 2, 1},
    {1, 4, 4, 33, 1, 3, 1, 1}, {2, 3, 4, 1, 33, 1, 1, 0},  {1, 5, 4, 17, 33, 2, 2, 0},
    {2, 4, 3, 3, 5, 4, 2, 1},  {1, 9, 2, 16, 32, 3, 1, 2}, {2, 1, 1, 3, 8, 3, 1, 1},
    {1, 8, 11, 5, 1, 4, 2, 1}, {1, 3, 3, 2, 2, 1, 3, 2}};

void maps(Cases& cases, const std::string& name, Convolve op) {
  for (const MapCase& c : kMaps) {
    const Dim least = (std::min(c.height, c.width) - 1) * c.stride - 2 * c.padding + c.kernel;
    if (op == conv_transpose2d && least < 1) continue;
    convolution(cases, name, op, {c.images, c.height, c.width, c.in}, {c.kernel, c.kernel, c.in, c.out},
                {.stride = c.stride, .padding = c.padding});
  }
}

void convolutions(Cases& cases) {
  const ConvOptions halving{.stride = 2, .padding = 1, .negative_slope = kLeakyRelu};
  for (const Dim channels : kChannels)
    convolution(cases, "conv1d", conv1d, {2, 9, channels}, {4, channels, 5}, halving, 200);
  for (const Dim channels : kChannels)
    convolution(cases, "conv_transpose1d", conv_transpose1d, {2, 9, channels}, {4, channels, 5}, halving,
                200);
  maps(cases, "conv2d", conv2d);
  convolution(cases, "conv2d", conv2d, {2, 5, 4, 3}, {3, 2, 3, 5}, halving);
  // Few outputs, and maps that are transformed: each is computed in a way of its own (kernels/fast).
  convolution(cases, "conv2d", conv2d, {2, 4, 5, 7}, {3, 3, 7, 1}, {.padding = 1});
  convolution(cases, "conv2d", conv2d, {4, 8, 8, 16}, {3, 3, 16, 16}, {.padding = 1}, 40);
  maps(cases, "conv_transpose2d", conv_transpose2d);
  const struct {
    Dim rows, in, out;
  } matrices[] = {{1, 1, 1}, {2, 3, 17}, {1, 33, 3}, {19, 17, 33}, {2, 40, 512}};
  for (const auto& m : matrices)
    for (const real negative_slope : {kNoActivation, kRelu, kLeakyRelu})
      cases.op(
          "linear", {"x", "weight", "bias"},
          {uniform({m.rows, m.in}, 1), uniform({m.in, m.out}, 2), uniform({m.out}, 3)},
          [=](const Leaves& in) { return linear(in[0], in[1], in[2], negative_slope); }, {},
          activation_text(negative_slope));
}

void shaping(Cases& cases) {
  for (const Dim channels : {1, 3, 17}) {
    Tensor apart({2, 5, 4, channels});  // no two values closer than the steps of the differences
    for (Dim i = 0; i < apart.size(); ++i)
      apart.data()[i] = static_cast<real>(0.05 * double(i * 7919 % apart.size()));
    cases.op("max_pool2d", {"x"}, {apart}, [](const Leaves& in) { return max_pool2d(in[0]); },
             {.step = 1e-4});
  }
  cases.op("concat", {"x0", "x1", "x2"},
           {uniform({2, 3, 1}, 1), uniform({2, 3, 17}, 2), uniform({2, 3, 3}, 3)},
           [](const Leaves& in) { return concat(in); });
  cases.op("concat", {"x"}, {uniform({2, 3}, 1)}, [](const Leaves& in) {
    return concat(std::array{in[0], in[0]});
  });
  cases.op("flatten_channels_first", {"x"}, {uniform({2, 3, 5, 4}, 1)},
           [](const Leaves& in) { return flatten_channels_first(in[0]); });
  cases.op("unflatten_channels_first", {"x"}, {uniform({2, 18}, 1)}, [](const Leaves& in) {
    return unflatten_channels_first(in[0], std::array<Dim, 2>{2, 3});
  });
}

void losses(Cases& cases) {
  for (const Shape& shape : {Shape{2, 5, 3, 1}, Shape{1}, Shape{33, 17}})
    cases.op("l2_loss", {"x", "target"}, {uniform(shape, 1), uniform(shape, 2)},
             [](const Leaves& in) { return l2_loss(in[0], in[1]); });
  for (const Shape& shape :
       {Shape{2, 16, 13, 1}, Shape{1, 8, 9, 1}, Shape{1, 6, 10, 1}, Shape{1, 3, 4, 1}, Shape{5, 11, 11, 1}}) {
    const Tensor target = uniform(shape, 2, 0, 1);
    cases.op("ssim", {"x"}, {uniform(shape, 1, 0, 1)}, [=](const Leaves& in) { return ssim(in[0], target); });
  }
  const Tensor opposite = uniform({1, 16, 16, 1}, 1, 1, 0);
  cases.op("ssim", {"x"}, {uniform(opposite.shape(), 1, 0, 1)},
           [=](const Leaves& in) { return ssim(in[0], opposite); });
  cases.op("softmax_cross_entropy", {"logits"}, {uniform({3, 7}, 1, -3, 3)}, [](const Leaves& in) {
    return softmax_cross_entropy(in[0], std::array<std::int32_t, 3>{2, 0, 6});
  });
  const F divergence = [](const Leaves& in) { return kl_divergence(in.front(), in.back()); };
  for (const Shape& shape : {Shape{2, 3}, Shape{1, 17}, Shape{5, 33}}) {
    const Tensor eps = uniform(shape, 3, -2, 2);
    cases.op("sample_gaussian", {"mean", "log_var"}, {uniform(shape, 1), uniform(shape, 2)},
             [=](const Leaves& in) { return sample_gaussian(in[0], in[1], eps); });
  }
  for (const Shape& shape : {Shape{2, 3}, Shape{1, 17}, Shape{5, 33}}) {
    cases.op("kl_divergence", {"mean", "log_var"}, {uniform(shape, 1), uniform(shape, 2)}, divergence);
    cases.op("kl_divergence", {"mean"}, {uniform(shape, 1)}, divergence);
  }
}

// At the initial weights the deepest gradients are 1e-10 of the loss, below what a difference of doubles
// resolves.
template <class M>
M with_larger_weights(const M& model) {
  for (Variable v : values_of(model.parameters())) {
    if (v.rank() < 2) continue;
    for (real& w : v.mutable_value().values()) w *= real(2.2);
  }
  return model;
}

// With a predicted error its head alone is asked for: the loss takes the picture as given there, differences
// do not.
void supertac_losses(Cases& cases, const std::string& name, const SuperTacSettings& s) {
  Rng rng(11);  // one for which no rectifier is within 1e-6 of its kink
  const Tensor windows = uniform({2, s.timesteps, s.signals()}, 1, 0, 1);
  const Tensor truth = uniform({2, s.image_height(), s.image_width(), 1}, 2, 0, 1);
  std::vector<Tensor> eps;
  for (Dim i = 0; i < s.groups(); ++i)
    eps.push_back(uniform({2, s.latent}, 3 + static_cast<std::uint64_t>(i), 0, 1));
  const SuperTac model = with_larger_weights(SuperTac(s, rng));
  std::vector<Parameter> asked = model.parameters();
  if (s.predicted_error)
    std::erase_if(asked, [](const Parameter& p) { return !p.name.starts_with("upsampler.spread."); });
  const auto loss = [=](const Variable&) {
    return supertac_loss(model.forward(windows, eps), truth, {.a = 0.5, .beta = 0.01, .lambda = 0.3}).total;
  };
  cases.module(name, asked, {}, loss, 4);
}

std::vector<GradientCase> layer_cases() {
  Cases cases("layer");
  Rng rng(1);
  cases.layer("Linear", Linear(5, 3, rng), {4, 5});
  cases.layer("Conv1d", Conv1d(3, 5, {.kernel = 3, .stride = 2, .padding = 1}, rng), {2, 9, 3});
  cases.layer("Conv2d", Conv2d(3, 5, {.kernel = 3, .stride = 1, .padding = 1}, rng), {2, 5, 4, 3});
  cases.layer("ConvTranspose1d", ConvTranspose1d(5, 3, {.kernel = 4, .stride = 2, .padding = 1}, rng),
              {2, 5, 5});
  cases.layer("ConvTranspose2d", ConvTranspose2d(5, 3, {.kernel = 4, .stride = 2, .padding = 1}, rng),
              {2, 3, 4, 5});
  const ChannelAttention attention(8, rng);
  cases.module(
      "ChannelAttention", attention.parameters(), uniform({2, 4, 3, 8}, 2),
      [=](const Variable& x) { return attention.gates(x); }, 200);
  cases.layer("Rcab", Rcab(8, rng), {2, 4, 3, 8});
  cases.layer("Rirb", Rirb(8, 2, rng), {1, 3, 4, 8});
  const VaeOptions vae{.timesteps = 32, .channels = 4, .latent = 3};
  const Encoder encoder = with_larger_weights(Encoder(vae, rng));
  const auto encode = [=](const Variable& x) {
    const LatentDistribution latent = encoder.forward(x);
    return concat(std::array{latent.mean, latent.log_var});
  };
  cases.module("Encoder", encoder.parameters(), uniform({2, 32, 4}, 2), encode, 20);
  cases.layer("Decoder", with_larger_weights(Decoder(vae, rng)), {2, 3}, 20);
  cases.layer("TextureClassifier", TextureClassifier({.height = 8, .width = 8, .classes = 3}, rng),
              {2, 8, 8, 1});
  return cases.take();
}

std::vector<GradientCase> loss_cases() {
  Cases cases("loss");
  SuperTacSettings small{.timesteps = 32, .latent = 3, .scale = 2, .channels = 8};
  supertac_losses(cases, "SuperTac, 8x8 pixels", small);
  small = {.timesteps = 48, .latent = 2, .grouping = Grouping::vertical, .channels = 8, .rcabs = 1};
  supertac_losses(cases, "SuperTac, 16x16 pixels", small);
  small.predicted_error = true;
  supertac_losses(cases, "SuperTac's predicted_error", small);
  small = {.timesteps = 32, .latent = 2, .scale = 2, .channels = 8, .rcabs = 1, .last_frame_path = true};
  supertac_losses(cases, "SuperTac's last_frame_path", small);
  // Rows, columns and channels all differ, so that none can stand for another.
  small = {
      .rows = 3, .columns = 5, .in_channels = 2, .timesteps = 32, .latent = 2, .channels = 4, .rcabs = 1};
  for (const Grouping grouping : {Grouping::horizontal, Grouping::vertical}) {
    small.grouping = grouping;
    supertac_losses(cases, "SuperTac, 3x5 taxels x 2", small);
  }
  small = {.rows = 2, .columns = 5, .in_channels = 2, .timesteps = 1, .channels = 8, .rcabs = 1};
  supertac_losses(cases, "SuperTac, single frames", small);
  return cases.take();
}

}  // namespace

std::vector<GradientCase> op_cases() {
  Cases cases("op");
  for (const auto& add : {elementwise, attention, convolutions, shaping, losses}) add(cases);
  return cases.take();
}

std::vector<GradientCase> gradient_cases() {
  std::vector<GradientCase> all = op_cases();
  for (const auto& more : {layer_cases(), loss_cases()}) all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace supertac
