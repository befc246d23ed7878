#include "models/supertac_model.h"

#include <stdexcept>

#include "autograd/ops/activations.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"

namespace supertac {
namespace {

constexpr Dim kCoarse = 4;  // the upsampler starts on a map of 4x4

void check_range(const char* name, Dim value, Dim low, Dim high) {
  if (value >= low && value <= high) return;
  throw std::invalid_argument(std::string("model settings: ") + name + " must be " + std::to_string(low) +
                              " to " + std::to_string(high) + ", got " + std::to_string(value));
}

SuperTacSettings checked(const SuperTacSettings& settings) {
  settings.check();
  return settings;
}

VaeOptions vae_options(const SuperTacSettings& s) {
  return {.timesteps = s.timesteps, .channels = kGroupTaxels, .latent = s.latent};
}

template <class Part>
std::vector<Part> make_parts(const SuperTacSettings& s, Rng& rng) {
  std::vector<Part> parts;
  for (Dim i = 0; i < kGroups; ++i) parts.emplace_back(vae_options(s), rng);
  return parts;
}

std::vector<Rirb> make_rirbs(const SuperTacSettings& s, Rng& rng) {
  std::vector<Rirb> rirbs;
  for (Dim size = 1; size < s.scale; size *= 2) {
    rirbs.emplace_back(RirbOptions{.channels = s.channels, .blocks = s.rcabs, .sub_pixel = s.sub_pixel}, rng);
  }
  return rirbs;
}

}  // namespace

Grouping grouping_of(const std::string& name) {
  if (name == "horizontal") return Grouping::horizontal;
  if (name == "vertical") return Grouping::vertical;
  throw std::invalid_argument("grouping must be horizontal or vertical, got \"" + name + "\"");
}

std::string name_of(Grouping grouping) {
  return grouping == Grouping::horizontal ? "horizontal" : "vertical";
}

void SuperTacSettings::check() const {
  check_range("timesteps", timesteps, 32, 512);
  if (timesteps % 16 != 0) {
    throw std::invalid_argument(
        "model settings: timesteps must be a multiple of 16 (the encoder halves four times), got " +
        std::to_string(timesteps));
  }
  check_range("latent", latent, 1, 256);
  if (scale != 2 && scale != 4 && scale != 8) {
    throw std::invalid_argument("model settings: scale must be 2, 4 or 8, got " + std::to_string(scale));
  }
  check_range("channels", channels, 4, 256);
  check_range("rcabs", rcabs, 0, 16);
}

SuperTacSettings SuperTacSettings::of_preset(const std::string& name) {
  if (name == "paper") return {};
  if (name == "tiny") return {.preset = "tiny", .timesteps = 128, .channels = 8, .rcabs = 1};
  throw std::invalid_argument("unknown preset \"" + name + "\"; known: paper, tiny");
}

double rate_of_preset(const std::string& name) {
  constexpr double kWindowS = 2.56;
  return static_cast<double>(SuperTacSettings::of_preset(name).timesteps) / kWindowS;
}

Upsampler::Upsampler(const SuperTacSettings& s, Rng& rng)
    : fc_(kGroups * s.latent, s.channels * kCoarse * kCoarse, rng),
      rirbs_(make_rirbs(s, rng)),
      out_(s.channels, 1, {.kernel = 3, .stride = 1, .padding = 1}, rng) {
  add("fc", fc_);
  for (std::size_t i = 0; i < rirbs_.size(); ++i) add("rirb." + std::to_string(i), rirbs_[i]);
  add("out", out_);
}

Variable Upsampler::forward(const Variable& latents) const {
  const Dim pixels[] = {kCoarse, kCoarse};
  Variable h = unflatten_channels_first(fc_.forward(latents, kLeakyRelu), pixels);
  for (const Rirb& rirb : rirbs_) h = rirb.forward(h);
  return out_.forward(h);
}

SuperTac::SuperTac(const SuperTacSettings& settings, Rng& rng)
    : settings_(checked(settings)),
      encoders_(make_parts<Encoder>(settings, rng)),
      decoders_(make_parts<Decoder>(settings, rng)),
      upsampler_(settings, rng) {
  for (std::size_t i = 0; i < encoders_.size(); ++i) add("encoder." + std::to_string(i), encoders_[i]);
  for (std::size_t i = 0; i < decoders_.size(); ++i) add("decoder." + std::to_string(i), decoders_[i]);
  add("upsampler", upsampler_);
}

std::array<Variable, kGroups> SuperTac::split(const Tensor& windows) const {
  if (windows.rank() != 3 || windows.dim(1) != settings_.timesteps || windows.dim(2) != kWindowTaxels) {
    throw std::invalid_argument("SuperTac: windows expects [N," + std::to_string(settings_.timesteps) +
                                ",16], got " + windows.shape().text());
  }
  const bool rows = settings_.grouping == Grouping::horizontal;
  const Dim first_step = rows ? kGroupTaxels : 1, step = rows ? 1 : kGroups;
  const Dim frames = windows.dim(0) * windows.dim(1);
  std::array<Variable, kGroups> groups;
  for (Dim g = 0; g < kGroups; ++g) {
    Tensor part(Shape{windows.dim(0), windows.dim(1), kGroupTaxels});
    const real* from = windows.data() + g * first_step;
    real* to = part.data();
    for (Dim f = 0; f < frames; ++f, from += kWindowTaxels, to += kGroupTaxels) {
      for (Dim k = 0; k < kGroupTaxels; ++k) to[k] = from[k * step];
    }
    groups[static_cast<std::size_t>(g)] = Variable(std::move(part));
  }
  return groups;
}

SuperTac::Output SuperTac::forward(const Tensor& windows, const std::array<Tensor, kGroups>& eps) const {
  Output out;
  out.input = split(windows);
  std::array<Variable, kGroups> z;
  for (std::size_t i = 0; i < z.size(); ++i) {
    out.latent[i] = encoders_[i].forward(out.input[i]);
    z[i] = sample_gaussian(out.latent[i].mean, out.latent[i].log_var, eps[i]);
    out.decoded[i] = decoders_[i].forward(z[i]);
  }
  out.image = upsampler_.forward(concat(z));
  return out;
}

Tensor SuperTac::encode(const Tensor& windows) const {
  const NoGrad no_grad;
  const std::array<Variable, kGroups> groups = split(windows);
  std::array<Variable, kGroups> means;
  for (std::size_t i = 0; i < means.size(); ++i) means[i] = encoders_[i].mean(groups[i]);
  return concat(means).value();
}

Tensor SuperTac::infer(const Tensor& windows) const {
  const NoGrad no_grad;
  return upsampler_.forward(Variable(encode(windows))).value();
}

}  // namespace supertac
