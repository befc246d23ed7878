#include "models/networks/supertac_model.h"

#include <algorithm>
#include <array>
#include <bit>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/shaping.h"
#include "autograd/ops/vae.h"
#include "autograd/record.h"

namespace supertac {
namespace {

constexpr Dim kMostWeights = Dim{1} << 28;

constexpr const char* kSettings = "model settings";  // what messages begin with

SuperTacSettings checked(const SuperTacSettings& settings) {
  settings.check();
  return settings;
}

VaeOptions vae_options(const SuperTacSettings& s) {
  return {.timesteps = s.timesteps, .channels = s.group_signals(), .latent = s.latent};
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
  refuse(kSettings, "grouping", "horizontal or vertical", "\"" + name + "\"");
}

std::string name_of(Grouping grouping) {
  return grouping == Grouping::horizontal ? "horizontal" : "vertical";
}

void SuperTacSettings::check() const {
  const auto text = [](Dim number) { return std::to_string(number); };
  const std::string array = text(rows) + "x" + text(columns);
  check_between(kSettings, "rows", rows, 1, kMostLines);
  check_between(kSettings, "columns", columns, 1, kMostLines);
  check_between(kSettings, "in_channels", in_channels, 1, 8);
  if (timesteps != 1) check_between(kSettings, "timesteps", timesteps, 32, 512);
  if (timesteps != 1 && timesteps % 16 != 0)
    refuse(kSettings, "timesteps", "a multiple of 16 (the encoder halves four times) or 1", text(timesteps));
  check_between(kSettings, "latent", latent, 1, 256);
  if (scale != 2 && scale != 4 && scale != 8 && scale != 16)
    refuse(kSettings, "scale", "2, 4, 8 or 16", text(scale));
  const auto [least, most] = std::minmax({image_height(), image_width()});
  if (least < 3 || most > 1024)
    refuse(kSettings, "scale " + text(scale) + " of an array of " + array,
           "pictures of 3 to 1024 pixels a side", text(image_height()) + "x" + text(image_width()));
  check_between(kSettings, "channels", channels, 4, 256);
  check_between(kSettings, "rcabs", rcabs, 0, 16);
  if (latents() * channels * rows * columns > kMostWeights)
    refuse(kSettings, "latent of an array of " + array, "a layer of at most 2^28 weights",
           text(latents()) + " latents; choose fewer latents or channels");
}

SuperTacSettings SuperTacSettings::of_preset(const std::string& name) {
  if (name == "paper") return {.preset = name, .predicted_error = true};
  if (name == "tiny")
    return {.preset = "tiny", .timesteps = 128, .channels = 8, .rcabs = 1, .predicted_error = true};
  if (name == "frame") return {.preset = name, .timesteps = 1, .predicted_error = true};
  refuse(kSettings, "preset", "paper, tiny or frame", "\"" + name + "\"");
}

Upsampler::Upsampler(const SuperTacSettings& s, Rng& rng)
    : rows_(s.rows), columns_(s.columns), in_channels_(s.in_channels) {
  if (s.latents() > 0) fc_.emplace(add("fc", Linear(s.latents(), s.channels * s.rows * s.columns, rng)));
  const auto doublings = static_cast<Dim>(std::countr_zero(static_cast<std::uint64_t>(s.scale)));
  rirbs_ = add_each("rirb", doublings, [&](Dim) { return Rirb(s.channels, s.rcabs, rng); });
  out_.emplace(add("out", Conv2d(s.channels, 1, kSameSize, rng)));
  // In files the predicted error is called spread, as it was at first.
  if (s.predicted_error) predicted_error_.emplace(add("spread", Conv2d(s.channels, 1, kSameSize, rng)));
  if (s.sees_last_frame())
    last_frame_.emplace(add("last_frame", Conv2d(s.in_channels, s.channels, kSameSize, rng)));
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
  for (const Rirb& rirb : rirbs_) h = rirb.forward(h);  // [N,H,W,channels] to [N,2H,2W,channels] by each
  return {out_->forward(h), predicted_error_ ? predicted_error_->forward(h) : Variable(), latents};
}

SuperTac::SuperTac(const SuperTacSettings& settings, Rng& rng)
    : settings_(checked(settings)),
      encoders_(
          add_each("encoder", settings.groups(), [&](Dim) { return Encoder(vae_options(settings), rng); })),
      decoders_(
          add_each("decoder", settings.groups(), [&](Dim) { return Decoder(vae_options(settings), rng); })),
      upsampler_(add("upsampler", Upsampler(settings, rng))) {}

// The signals of a group are its taxels in order, each with its channels.
PerGroup<Variable> SuperTac::split(const Variable& windows) const {
  const SuperTacSettings& s = settings_;
  check_defined("SuperTac", "windows", windows);
  if (windows.rank() != 3 || windows.dim(1) != s.timesteps || windows.dim(2) != s.signals()) {
    refuse("SuperTac", "windows",
           "[N," + std::to_string(s.timesteps) + "," + std::to_string(s.signals()) + "]",
           windows.shape().text());
  }
  const Dim row = s.columns * s.in_channels;
  const Dim run = s.grouping == Grouping::horizontal ? row : s.in_channels;
  PerGroup<Variable> groups(static_cast<std::size_t>(s.groups()));
  for (std::size_t g = 0; g < groups.size(); ++g)
    groups[g] = take_runs(windows, {static_cast<Dim>(g) * run, run, row, s.group_signals()});  // [N,T,group]
  return groups;
}

SuperTac::Output SuperTac::forward(const Tensor& windows, std::span<const Tensor> eps) const {
  const auto groups = static_cast<std::size_t>(settings_.groups());
  if (eps.size() != groups) {
    refuse("SuperTac", "eps", std::to_string(groups) + " tensors", std::to_string(eps.size()));
  }
  Output out{
      split(Variable(windows)), PerGroup<LatentDistribution>(groups), PerGroup<Variable>(groups), {}, {}};
  PerGroup<Variable> z(groups);
  for (std::size_t i = 0; i < z.size(); ++i) {
    out.latent[i] = encoders_[i].forward(out.input[i]);  // [N,T,group_signals] -> [N,LD] each
    z[i] = sample_gaussian(out.latent[i].mean, out.latent[i].log_var, eps[i]);
    out.decoded[i] = decoders_[i].forward(z[i]);  // [N,LD] -> [N,T,group_signals]
  }
  const Prediction drawn = upsampler_.forward(concat_groups(z), Variable(windows));  // of [N,G LD]
  out.picture = drawn.picture, out.predicted_error = drawn.predicted_error;  // [N,rows scale,columns scale,1]
  return out;
}

std::string text(const NetworkFormat& f) {
  return std::to_string(f.frames) + " frame(s) of " + std::to_string(f.rows) + "x" +
         std::to_string(f.columns) + " taxels with " + std::to_string(f.channels) +
         " channel(s) and pictures of " + std::to_string(f.rows * f.scale) + "x" +
         std::to_string(f.columns * f.scale);
}

NetworkFormat SuperTac::format() const {
  const SuperTacSettings& s = settings_;
  return {s.timesteps, s.rows, s.columns, s.in_channels, s.scale};
}

Variable SuperTac::means(const Variable& windows) const {
  const PerGroup<Variable> groups = split(windows);
  PerGroup<Variable> means(groups.size());
  for (std::size_t i = 0; i < means.size(); ++i) means[i] = encoders_[i].mean(groups[i]);  // [N,LD] each
  return concat_groups(means);                                                             // [N,G LD]
}

Tensor SuperTac::encode(const Tensor& windows) const {
  if (encoders_.empty())
    refuse("SuperTac", "encode()", "a model of windows", "one of single frames, which has no latents");
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
