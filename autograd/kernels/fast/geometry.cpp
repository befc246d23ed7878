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

// The pixels of a map from (top, left) on, `side` each way; -1 outside.
void add_pixels(const ConvSettings& map, Dim top, Dim left, Dim side, std::vector<std::int32_t>& pixels) {
  for (Dim y = top; y < top + side; ++y) {
    for (Dim x = left; x < left + side; ++x) {
      const bool inside = y >= 0 && y < map.height && x >= 0 && x < map.width;
      pixels.push_back(inside ? static_cast<std::int32_t>(y * map.width + x) : -1);
    }
  }
}

void add_tiles(const ConvSettings& s, Geometry& g) {
  const ConvSettings three_by_three{
      .height = s.height, .width = s.width, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1};
  if (s != three_by_three || s.height % 4 != 0 || s.width % 4 != 0) return;
  for (Dim y = 0; y < s.height; y += 4) {
    for (Dim x = 0; x < s.width; x += 4) {
      add_pixels(s, y, x, 4, g.squares);
      add_pixels(s, y - 1, x - 1, 6, g.patches);
    }
  }
}

Geometry build(const ConvSettings& s) {
  const Pairs pairs = pairs_of(s);
  Geometry g;
  g.conv = s;
  g.in_pixels = s.height * s.width;
  g.out_pixels = s.out_height() * s.out_width();
  g.taps = s.taps();
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
  add_tiles(s, g);
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
