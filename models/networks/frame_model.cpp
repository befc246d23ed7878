#include "models/networks/frame_model.h"

#include <stdexcept>
#include <string>

#include "autograd/ops/activations.h"

namespace supertac {
namespace {

void check_setting(const char* name, Dim value, Dim low, Dim high) {
  if (value >= low && value <= high) return;
  throw std::invalid_argument(std::string("frame model: ") + name + " must be " + std::to_string(low) +
                              " to " + std::to_string(high) + ", got " + std::to_string(value));
}

FrameSettings checked(const FrameSettings& settings) {
  settings.check();
  return settings;
}

std::vector<Rirb> make_rirbs(const FrameSettings& s, Rng& rng) {
  std::vector<Rirb> rirbs;
  for (Dim size = 1; size < s.scale; size *= 2)
    rirbs.emplace_back(RirbOptions{.channels = s.channels, .blocks = s.rcabs}, rng);
  return rirbs;
}

}  // namespace

void FrameSettings::check() const {
  check_setting("in_channels", in_channels, 1, 64);
  check_setting("height", height, 1, 512);
  check_setting("width", width, 1, 512);
  if (scale != 2 && scale != 4 && scale != 8 && scale != 16)
    throw std::invalid_argument("frame model: scale must be 2, 4, 8 or 16, got " + std::to_string(scale));
  check_setting("channels", channels, 4, 256);
  check_setting("rcabs", rcabs, 0, 16);
}

FrameModel::FrameModel(const FrameSettings& settings, Rng& rng)
    : settings_(checked(settings)),
      in_(settings.in_channels, settings.channels, kSameSize, rng),
      rirbs_(make_rirbs(settings, rng)),
      out_(settings.channels, 1, kSameSize, rng) {
  add("in", in_);
  for (std::size_t i = 0; i < rirbs_.size(); ++i) add("rirb." + std::to_string(i), rirbs_[i]);
  add("out", out_);
}

Variable FrameModel::forward(const Variable& frames) const {
  if (frames.rank() != 4 || frames.shape() != input_shape(frames.dim(0)))
    throw std::invalid_argument("FrameModel: frames expects " + input_shape(0).text() +
                                " with any first size, got " + frames.shape().text());
  Variable h = in_.forward(frames, kLeakyRelu);
  for (const Rirb& rirb : rirbs_) h = rirb.forward(h);
  return out_.forward(h);
}

NetworkFormat FrameModel::format() const {
  const FrameSettings& s = settings_;
  return {1, s.height, s.width, s.in_channels, s.scale};
}

Drawing FrameModel::draw(const Variable& frames) const {
  return {.picture = forward(frames), .predicted_error = {}, .latents = {}};
}

}  // namespace supertac
