#include "autograd/kernels/fast/geometry.h"

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

namespace supertac::kernels {

namespace {

struct Pair {
  std::int32_t input, output;
};
using Pairs = std::vector<std::vector<Pair>>;  // [taps]

Pairs pairs_of(const ConvSettings& s) {
  Pairs pairs(static_cast<std::size_t>(s.taps()));
  for_each_meeting({.conv = s, .images = 1}, [&](Dim tap, Dim input, Dim output) {
    pairs[static_cast<std::size_t>(tap)].push_back(
        {static_cast<std::int32_t>(input), static_cast<std::int32_t>(output)});
  });
  for (auto& tap : pairs) std::ranges::sort(tap, {}, &Pair::output);
  return pairs;
}

// Groups the outputs of a (width x height) map by y mod stride_y and x mod stride_x; within a group every
// output away from the border uses the same taps.
std::vector<Phase> phases_of(const Pairs& pairs, bool to_input, Dim height, Dim width, Dim stride_h,
                             Dim stride_w) {
  const auto pixels = static_cast<std::size_t>(height * width);
  std::vector<std::vector<std::int32_t>> source(pixels, std::vector<std::int32_t>(pairs.size(), -1));
  for (std::size_t t = 0; t < pairs.size(); ++t) {
    for (const Pair p : pairs[t]) {
      source[static_cast<std::size_t>(to_input ? p.input : p.output)][t] = to_input ? p.output : p.input;
    }
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
  const Pairs pairs = pairs_of(s);
  Geometry g;
  const Dim up_h = s.transposed ? s.stride_h : 1, up_w = s.transposed ? s.stride_w : 1;
  const Dim down_h = s.transposed ? 1 : s.stride_h, down_w = s.transposed ? 1 : s.stride_w;
  g.forward = phases_of(pairs, false, s.out_height(), s.out_width(), up_h, up_w);
  g.backward = phases_of(pairs, true, s.height, s.width, down_h, down_w);
  for (const auto& tap : pairs) {
    TapPairs& list = g.pairs.emplace_back();
    for (const Pair p : tap) {
      list.inputs.push_back(p.input);
      list.outputs.push_back(p.output);
    }
  }
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
