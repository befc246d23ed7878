#include "models/networks/supertac_model.h"

#include <algorithm>
#include <stdexcept>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"

namespace supertac {
namespace {

constexpr Dim kMostWeights = Dim{1} << 28;

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
  return {.timesteps = s.timesteps, .channels = s.group_signals(), .latent = s.latent};
}

template <class Part>
std::vector<Part> make_parts(const SuperTacSettings& s, Rng& rng) {
  std::vector<Part> parts;
  for (Dim i = 0; i < s.groups(); ++i) parts.emplace_back(vae_options(s), rng);
  return parts;
}

std::optional<Linear> fc_of(const SuperTacSettings& s, Rng& rng) {
  if (s.latents() == 0) return std::nullopt;
  return Linear(s.latents(), s.channels * s.rows * s.columns, rng);
}

std::vector<Rirb> make_rirbs(const SuperTacSettings& s, Rng& rng) {
  std::vector<Rirb> rirbs;
  for (Dim size = 1; size < s.scale; size *= 2) {
    rirbs.emplace_back(RirbOptions{.channels = s.channels, .blocks = s.rcabs}, rng);
  }
  return rirbs;
}

// concat() takes eight at most. Of no groups undefined.
Variable concat_groups(std::span<const Variable> groups) {
  constexpr std::size_t kAtOnce = 8;
  static_assert(kMostLines <= kAtOnce * kAtOnce);
  if (groups.empty()) return {};
  if (groups.size() <= kAtOnce) return concat(groups);
  std::array<Variable, kAtOnce> parts;
  std::size_t count = 0;
  for (; !groups.empty(); groups = groups.subspan(std::min(kAtOnce, groups.size())))
    parts[count++] = concat(groups.first(std::min(kAtOnce, groups.size())));
  return concat(std::span<const Variable>(parts).first(count));
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
  const bool frames = timesteps == 1;
  check_range("rows", rows, 1, kMostLines);
  check_range("columns", columns, 1, kMostLines);
  check_range("in_channels", in_channels, 1, 8);
  if (!frames) check_range("timesteps", timesteps, 32, 512);
  if (!frames && timesteps % 16 != 0) {
    throw std::invalid_argument(
        "model settings: timesteps must be a multiple of 16 (the encoder halves four times) or 1, got " +
        std::to_string(timesteps));
  }
  check_range("latent", latent, 1, 256);
  if (scale != 2 && scale != 4 && scale != 8 && scale != 16)
    throw std::invalid_argument("model settings: scale must be 2, 4, 8 or 16, got " + std::to_string(scale));
  const auto [least, most] = std::minmax({image_height(), image_width()});
  if (least < 3 || most > 1024)
    throw std::invalid_argument("model settings: scale " + std::to_string(scale) + " of an array of " +
                                std::to_string(rows) + "x" + std::to_string(columns) + " makes pictures of " +
                                std::to_string(image_height()) + "x" + std::to_string(image_width()) +
                                " pixels, expected 3 to 1024 a side");
  check_range("channels", channels, 4, 256);
  check_range("rcabs", rcabs, 0, 16);
  if (latents() * channels * rows * columns > kMostWeights)
    throw std::invalid_argument("model settings: " + std::to_string(latents()) + " latents of an array of " +
                                std::to_string(rows) + "x" + std::to_string(columns) +
                                " make a layer of more than 2^28 weights; choose fewer latents or channels");
}

SuperTacSettings SuperTacSettings::of_preset(const std::string& name) {
  if (name == "paper") return {.preset = name, .predicted_error = true};
  if (name == "tiny")
    return {.preset = "tiny", .timesteps = 128, .channels = 8, .rcabs = 1, .predicted_error = true};
  if (name == "frame") return {.preset = name, .timesteps = 1, .predicted_error = true};
  throw std::invalid_argument("unknown preset \"" + name + "\"; known: paper, tiny, frame");
}

Upsampler::Upsampler(const SuperTacSettings& s, Rng& rng)
    : rows_(s.rows),
      columns_(s.columns),
      in_channels_(s.in_channels),
      fc_(fc_of(s, rng)),
      rirbs_(make_rirbs(s, rng)),
      out_(s.channels, 1, kSameSize, rng) {
  if (s.predicted_error) predicted_error_.emplace(s.channels, 1, kSameSize, rng);
  if (s.sees_last_frame()) last_frame_.emplace(s.in_channels, s.channels, kSameSize, rng);
  if (fc_) add("fc", *fc_);
  for (std::size_t i = 0; i < rirbs_.size(); ++i) add("rirb." + std::to_string(i), rirbs_[i]);
  add("out", out_);
  if (predicted_error_) add("spread", *predicted_error_);
  if (last_frame_) add("last_frame", *last_frame_);
}

Variable Upsampler::map_of(const Variable& latents, const Variable& windows) const {
  const Dim pixels[] = {rows_, columns_};
  Variable past, present;
  if (fc_)
    past = unflatten_channels_first(fc_->forward(latents, kLeakyRelu), pixels);  // [N,rows,columns,channels]
  if (last_frame_) {  // [N,T,signals] -> [N,rows,columns,in_channels] -> [N,rows,columns,channels]
    present = last_frame_->forward(last_frame(windows, rows_, columns_, in_channels_), kLeakyRelu);
  }
  if (!fc_) return present;
  return last_frame_ ? past + present : past;
}

Prediction Upsampler::forward(const Variable& latents, const Variable& windows) const {
  Variable h = map_of(latents, windows);                // [N,rows,columns,channels]
  for (const Rirb& rirb : rirbs_) h = rirb.forward(h);  // twice as high and wide by each
  return {out_.forward(h), predicted_error_ ? predicted_error_->forward(h) : Variable(), latents};
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

// The signals of a group are its taxels in order, each with its channels.
PerGroup<Variable> SuperTac::split(const Variable& windows) const {
  const SuperTacSettings& s = settings_;
  if (windows.rank() != 3 || windows.dim(1) != s.timesteps || windows.dim(2) != s.signals()) {
    throw std::invalid_argument("SuperTac: windows expects [N," + std::to_string(s.timesteps) + "," +
                                std::to_string(s.signals()) + "], got " + windows.shape().text());
  }
  const Dim row = s.columns * s.in_channels;
  const Dim run = s.grouping == Grouping::horizontal ? row : s.in_channels;
  PerGroup<Variable> groups(s.groups());
  for (std::size_t g = 0; g < groups.size(); ++g)
    groups[g] = take_runs(windows, {static_cast<Dim>(g) * run, run, row, s.group_signals()});  // [N,T,group]
  return groups;
}

SuperTac::Output SuperTac::forward(const Tensor& windows, std::span<const Tensor> eps) const {
  const Dim groups = settings_.groups();
  if (eps.size() != static_cast<std::size_t>(groups)) {
    throw std::invalid_argument("SuperTac: eps expects " + std::to_string(groups) + " tensors, got " +
                                std::to_string(eps.size()));
  }
  Output out{
      split(Variable(windows)), PerGroup<LatentDistribution>(groups), PerGroup<Variable>(groups), {}, {}};
  PerGroup<Variable> z(groups);
  for (std::size_t i = 0; i < z.size(); ++i) {
    out.latent[i] = encoders_[i].forward(out.input[i]);  // [N,T,group_signals] -> [N,LD] each
    z[i] = sample_gaussian(out.latent[i].mean, out.latent[i].log_var, eps[i]);
    out.decoded[i] = decoders_[i].forward(z[i]);  // [N,LD] -> [N,T,group_signals]
  }
  const Prediction drawn = upsampler_.forward(concat_groups(z.span()), Variable(windows));  // of [N,G LD]
  out.picture = drawn.picture, out.predicted_error = drawn.predicted_error;  // [N,rows scale,columns scale,1]
  return out;
}

NetworkFormat SuperTac::format() const {
  const SuperTacSettings& s = settings_;
  return {s.timesteps, s.rows, s.columns, s.in_channels, s.scale};
}

Variable SuperTac::means(const Variable& windows) const {
  const PerGroup<Variable> groups = split(windows);
  PerGroup<Variable> means(settings_.groups());
  for (std::size_t i = 0; i < means.size(); ++i) means[i] = encoders_[i].mean(groups[i]);  // [N,LD] each
  return concat_groups(means.span());                                                      // [N,G LD]
}

Tensor SuperTac::encode(const Tensor& windows) const {
  if (encoders_.empty())
    throw std::invalid_argument("SuperTac: a model of single frames has no latents; choose one of windows");
  const NoGrad no_grad;
  return means(Variable(windows)).value();
}

Prediction SuperTac::draw(const Variable& windows) const {
  return upsampler_.forward(means(windows), windows);
}

Estimate SuperTac::estimate(const Tensor& windows) const {
  const NoGrad no_grad;
  const Prediction drawn = draw(Variable(windows));
  const auto value = [](const Variable& x) { return x.defined() ? x.value() : Tensor(); };
  return {drawn.picture.value(), value(drawn.predicted_error), value(drawn.latents)};
}

}  // namespace supertac
