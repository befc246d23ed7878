// The steps of models/inference/compiled/compiler.h that are products in Winograd's domain: 3x3 convolutions
// that keep the size of a map, and transposed 4x4 ones that double it.
#include <algorithm>

#include "models/inference/compiled/compiler.h"

namespace supertac {

using kernels::ConvSettings;
using kernels::place_step;

constexpr Dim kTilesAtOnce = 8;

// Taps of a 3x3 filter along one axis: all, or all but the last or the first, which is 0.
enum class Taps { three, first_two, last_two };

// A 3x3 convolution from the places of a map to every pixel of another, or to every second one.
struct Filters {
  Taps down = Taps::three, across = Taps::three;
  Dim y_offset = 0;  // from the map's first pixel
  Tensor u = {};     // [side(down)][side(across)][place]

  static Dim first(Taps t) { return t == Taps::last_two ? 1 : 0; }  // of the taps, and of the places
  static Dim count(Taps t) { return t == Taps::three ? 3 : 2; }
};

struct Winograd {
  kernels::TileJob from, to;
  Tensor bias;
  Dim place = 0;  // numbers from one place of u to the next
  real negative_slope = 1;
  FeatureMap x, y;
  std::vector<Filters> filters = {};

  Dim side() const { return from.square + 2; }
  Dim side(Taps t) const { return t == Taps::three ? side() : side() - 1; }
  /// Numbers in v; m, behind it in scratch, is as large for its own channels.
  Dim places(Dim channels) const { return side() * side() * place_step(kTilesAtOnce, channels); }
  Dim scratch() const { return places(from.channels) + places(to.channels); }
  void add(Filters f, const Tensor& w, const std::vector<Dim>& taps);
  void multiply(const Filters& f, Dim tiles, const real* v, real* m) const;
  void operator()(const Block& block) const;
};

// `taps`: where in w those of the filter begin that are there, row by row.
void Winograd::add(Filters f, const Tensor& w, const std::vector<Dim>& taps) {
  const Dim size = from.channels * to.channels;
  Tensor square = Tensor::zeros(Shape{3, 3, size}), all(Shape{side() * side(), place});
  const auto* tap = taps.data();
  for (Dim i = 0; i < Filters::count(f.down); ++i) {
    for (Dim j = 0; j < Filters::count(f.across); ++j)
      std::copy_n(w.data() + *tap++, size,
                  square.data() + (3 * (i + Filters::first(f.down)) + j + Filters::first(f.across)) * size);
  }
  isa().filters({size, place, from.square}, square.data(), all.data());
  f.u = Tensor(Shape{side(f.down) * side(f.across), place});
  for (Dim i = 0; i < side(f.down); ++i)
    std::copy_n(all.data() + ((i + Filters::first(f.down)) * side() + Filters::first(f.across)) * place,
                side(f.across) * place, f.u.data() + i * side(f.across) * place);
  filters.push_back(std::move(f));
}

// Fills m with the products of the places v of so many tiles.
void Winograd::multiply(const Filters& f, Dim tiles, const real* v, real* m) const {
  const auto& set = isa();
  const Dim down = side(f.down), across = side(f.across);
  const Dim v_step = place_step(tiles, from.channels), m_step = place_step(tiles, to.channels);
  const bool whole = down == side() && across == side();
  if (!whole) std::fill_n(m, side() * side() * m_step, real(0));
  const Dim runs = whole ? 1 : down, run = down * across / runs;
  for (Dim r = 0; r < runs; ++r) {
    const Dim at = (Filters::first(f.down) + r) * side() + Filters::first(f.across);
    set.places({run, tiles, from.channels, to.channels, place}, v + at * v_step, f.u.data() + r * run * place,
               m + at * m_step);
  }
}

void Winograd::operator()(const Block& block) const {
  const auto& set = isa();
  const Dim tiles = block.images * from.tiles_down * from.tiles_across;
  real* const v = block.scratch;
  real* const m = v + places(from.channels);
  for (Dim first = 0; first < tiles; first += kTilesAtOnce) {
    kernels::TileJob in = from, out = to;
    in.first = out.first = first;
    in.count = out.count = std::min(kTilesAtOnce, tiles - first);
    in.step = place_step(in.count, in.channels), out.step = place_step(out.count, out.channels);
    set.patches(in, block.first_pixel(x), v);
    for (const Filters& f : filters) {
      multiply(f, in.count, v, m);
      set.squares(out, m, bias.data(), Into::overwrite, negative_slope, block.first_pixel(y) + f.y_offset);
    }
  }
}

namespace {

// Tiles of 4x4 take fewer products than those of 2x2, though their weights are four times the direct ones.
Dim square_of(const FeatureMap& x) { return x.height % 4 == 0 && x.width % 4 == 0 ? 4 : 2; }

Winograd winograd_step(const TracedOp& op, const FeatureMap& x, const FeatureMap& y, kernels::Strides to) {
  constexpr Dim kPadding = 16;  // powers of two apart the places share cache lines
  const Dim square = square_of(x), down = x.height / square, across = x.width / square;
  return {.from = {down, across, x.strides(), x.channels, square, true},
          .to = {down, across, to, y.channels, square},
          .bias = op.inputs[2].value().clone(),
          .place = x.channels * y.channels + kPadding,
          .negative_slope = op.settings.negative_slope,
          .x = x,
          .y = y};
}

bool is_of_tiles(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const Dim cin = op.inputs[0].dim(op.inputs[0].rank() - 1), cout = op.y.dim(op.y.rank() - 1);
  return cin % kernels::kTransformChannels == 0 && cout % kernels::kTransformChannels == 0 &&
         s.height % 2 == 0 && s.width % 2 == 0;
}

// The taps that output (top, left) of every two by two sees: output 2t sees input t - 1 through tap 3 and t
// through tap 1, output 2t + 1 input t through tap 2, t + 1 through 0.
std::vector<Dim> quarter_taps(Dim top, Dim left, Dim size) {
  constexpr Dim kTaps[2][2] = {{3, 1}, {2, 0}};
  std::vector<Dim> taps;
  for (const Dim ky : kTaps[top]) {
    for (const Dim kx : kTaps[left]) taps.push_back((4 * ky + kx) * size);
  }
  return taps;
}

}  // namespace

void Compiler::conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const Dim kernel = s.transposed ? 4 : 3, stride = s.transposed ? 2 : 1;
  const bool keeps_or_doubles = s == ConvSettings{.height = s.height,
                                                  .width = s.width,
                                                  .kernel_h = kernel,
                                                  .kernel_w = kernel,
                                                  .stride_h = stride,
                                                  .stride_w = stride,
                                                  .padding_h = 1,
                                                  .padding_w = 1,
                                                  .transposed = s.transposed};
  if (!keeps_or_doubles) return product(op);
  if (!s.transposed && op.y.dim(op.y.rank() - 1) == 1) return plane_conv(op);
  is_of_tiles(op) ? winograd(op) : product(op);
}

// Each quarter of a doubled map is a convolution with two by two of the three by three inputs around. The
// first point of Winograd's transform, 0, sees the first tap alone and the last, infinity, the last one:
// where these are 0, so is a row or a column of places.
void Compiler::winograd(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  const Tensor& w = op.inputs[1].value();
  const Dim size = x.channels * y.channels;
  const bool doubles = op.settings.conv.transposed;
  Winograd step = winograd_step(
      op, x, y, doubles ? kernels::Strides{y.image(), 2 * y.line(), 2 * y.channels} : y.strides());
  if (!doubles)
    step.add({}, w, {0, size, 2 * size, 3 * size, 4 * size, 5 * size, 6 * size, 7 * size, 8 * size});
  constexpr Taps kTaps[] = {Taps::first_two, Taps::last_two};
  for (Dim top = 0; doubles && top < 2; ++top)
    for (Dim left = 0; left < 2; ++left)
      step.add({kTaps[top], kTaps[left], top * y.line() + left * y.channels}, w,
               quarter_taps(top, left, size));
  plan_->scratch_ = std::max(plan_->scratch_, step.scratch());
  add_step(std::move(step));
}

}  // namespace supertac
