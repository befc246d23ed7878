#include "autograd/kernels/fast/geometry.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace supertac::kernels {

namespace {

// Meetings come in ascending order of the pixels on either side.
std::vector<TapPairs> pairs_of(const ConvSettings& s) {
  std::vector<TapPairs> pairs(static_cast<std::size_t>(s.taps()));
  for_each_meeting({.conv = s, .images = 1}, [&](Dim tap, Dim input, Dim output) {
    TapPairs& of_tap = pairs[static_cast<std::size_t>(tap)];
    of_tap.inputs.push_back(static_cast<std::int32_t>(input));
    of_tap.outputs.push_back(static_cast<std::int32_t>(output));
  });
  return pairs;
}

// Groups the outputs of a (width x height) map by y mod stride_h and x mod stride_w; within a group every
// output away from the border uses the same taps.
std::vector<Phase> phases_of(const std::vector<TapPairs>& pairs, bool to_input, Dim height, Dim width,
                             Dim stride_h, Dim stride_w) {
  const auto pixels = static_cast<std::size_t>(height * width);
  std::vector<std::vector<std::int32_t>> source(pixels, std::vector<std::int32_t>(pairs.size(), -1));
  for (std::size_t t = 0; t < pairs.size(); ++t) {
    const auto& to = to_input ? pairs[t].inputs : pairs[t].outputs;
    const auto& from = to_input ? pairs[t].outputs : pairs[t].inputs;
    for (std::size_t i = 0; i < to.size(); ++i) source[static_cast<std::size_t>(to[i])][t] = from[i];
  }
  std::vector<Phase> phases;
  for (Dim py = 0; py < stride_h; ++py) {
    for (Dim px = 0; px < stride_w; ++px) {
      Phase phase;
      for (Dim y = py; y < height; y += stride_h) {
        for (Dim x = px; x < width; x += stride_w) {
          phase.outputs.push_back(static_cast<std::int32_t>(y * width + x));
        }
      }
      for (std::size_t t = 0; t < pairs.size(); ++t) {
        const bool used = std::any_of(phase.outputs.begin(), phase.outputs.end(), [&](std::int32_t q) {
          return source[static_cast<std::size_t>(q)][t] >= 0;
        });
        if (used) phase.taps.push_back(static_cast<std::int32_t>(t));
      }
      for (const std::int32_t q : phase.outputs) {
        for (const std::int32_t t : phase.taps) {
          phase.sources.push_back(source[static_cast<std::size_t>(q)][static_cast<std::size_t>(t)]);
        }
      }
      if (!phase.outputs.empty()) phases.push_back(std::move(phase));
    }
  }
  return phases;
}

Geometry build(const ConvSettings& s) {
  Geometry g{.forward = {}, .backward = {}, .pairs = pairs_of(s)};
  const Dim up_h = s.transposed ? s.stride_h : 1, up_w = s.transposed ? s.stride_w : 1;
  const Dim down_h = s.transposed ? 1 : s.stride_h, down_w = s.transposed ? 1 : s.stride_w;
  g.forward = phases_of(g.pairs, false, s.out_height(), s.out_width(), up_h, up_w);
  g.backward = phases_of(g.pairs, true, s.height, s.width, down_h, down_w);
  return g;
}

}  // namespace

const Geometry& geometry_of(const ConvSettings& settings) {
  // Never destroyed: what is still computed while the program ends refers to them.
  static auto& known = *new std::map<ConvSettings, std::unique_ptr<Geometry>>;
  static std::mutex mutex;
  const std::lock_guard lock(mutex);  // once for each convolution and each of its gradients
  std::unique_ptr<Geometry>& geometry = known[settings];
  if (geometry == nullptr) geometry = std::make_unique<Geometry>(build(settings));
  return *geometry;
}

}  // namespace supertac::kernels
