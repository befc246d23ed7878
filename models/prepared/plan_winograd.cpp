// The steps of models/prepared/planner.h that are products in Winograd's domain: 3x3 convolutions that keep
// the size of a map, and transposed 4x4 ones that double it.
#include <algorithm>

#include "models/prepared/planner.h"

namespace supertac {

using kernels::ConvSettings;

namespace {

constexpr Dim kTilesAtOnce = 8;

// Tiles of 4x4 take fewer products than those of 2x2; their weights, four times the direct ones, come from a
// slower cache, which a picture alone feels where its maps are small.
Dim square_of(const Map& x) { return x.height % 4 == 0 && x.width % 4 == 0 ? 4 : 2; }

// A 3x3 convolution from the places of a map to every pixel of another, or to every second one.
struct Filters {
  Dim row = 0, column = 0, side = 0;  // the square of places that are not zero throughout
  Tensor u;                           // [side][side][place]
  Dim y_offset = 0;                   // from the map's first pixel
};

struct Winograd {
  kernels::MapTileJob from, to;
  Tensor bias;
  Dim place = 0;  // numbers from one place of u to the next
  real negative_slope = 1;
  Map x, y;
  std::vector<Filters> filters;

  Dim side() const { return from.square + 2; }
  Dim scratch() const { return side() * side() * kTilesAtOnce * (from.channels + to.channels); }
  void add(const Tensor& w, Dim row, Dim column, Dim own_side, Dim y_offset);
  void operator()(const Block& block) const;
};

// w: [3][3][cin][cout]
void Winograd::add(const Tensor& w, Dim row, Dim column, Dim own_side, Dim y_offset) {
  Filters f{row, column, own_side, Tensor(Shape{own_side * own_side, place}), y_offset};
  Tensor all(Shape{side() * side(), place});
  isa().filters({from.channels * to.channels, place, from.square}, w.data(), all.data());
  for (Dim r = 0; r < own_side; ++r)
    std::copy_n(all.data() + ((row + r) * side() + column) * place, own_side * place,
                f.u.data() + r * own_side * place);
  filters.push_back(std::move(f));
}

void Winograd::operator()(const Block& block) const {
  const auto& set = isa();
  const Dim tiles = block.images * from.tiles_down * from.tiles_across;
  real* const v = block.scratch;
  real* const m = v + side() * side() * kTilesAtOnce * from.channels;
  for (Dim first = 0; first < tiles; first += kTilesAtOnce) {
    kernels::MapTileJob in = from, out = to;
    in.first = out.first = first;
    in.count = out.count = std::min(kTilesAtOnce, tiles - first);
    in.step = in.count * in.channels, out.step = out.count * out.channels;
    set.map_patches(in, block.first_pixel(x) - x.line() - x.channels, v);
    for (const Filters& f : filters) {
      if (f.side < side()) std::fill_n(m, side() * side() * out.step, real(0));
      const Dim runs = f.side < side() ? f.side : 1, run = f.side * f.side / runs;
      for (Dim r = 0; r < runs; ++r) {
        const Dim at = (f.row + r) * side() + f.column;
        set.places({run, in.count, in.channels, out.channels, place}, v + at * in.step,
                   f.u.data() + r * run * place, m + at * out.step);
      }
      set.map_squares(out, m, bias.data(), negative_slope, block.first_pixel(y) + f.y_offset);
    }
  }
}

Winograd winograd_step(const TracedOp& op, const Map& x, const Map& y, kernels::Strides to) {
  constexpr Dim kPadding = 16;  // powers of two apart the places share cache lines
  const Dim square = square_of(x), down = x.height / square, across = x.width / square;
  return {.from = {down, across, x.strides(), x.channels, square},
          .to = {down, across, to, y.channels, square},
          .bias = op.inputs[2].value().clone(),
          .place = x.channels * y.channels + kPadding,
          .negative_slope = op.settings.negative_slope,
          .x = x,
          .y = y,
          .filters = {}};
}

bool is_of_tiles(const TracedOp& op) {
  const ConvSettings& s = op.settings.map;
  const Dim cin = op.inputs[0].dim(op.inputs[0].rank() - 1), cout = op.y.dim(op.y.rank() - 1);
  return cin % kernels::kTransformChannels == 0 && cout % kernels::kTransformChannels == 0 &&
         s.height % 2 == 0 && s.width % 2 == 0;
}

// [4][4][cin][cout] -> [3][3][cin][cout]: what output (top, left) of every two by two sees of the inputs
// around. Output 2t sees input t - 1 through tap 3 and t through tap 1, output 2t + 1 input t through tap 2,
// t + 1 through 0.
Tensor quarter_weights(const Variable& w, Dim top, Dim left) {
  constexpr Dim kNone = -1, kTaps[2][3] = {{3, 1, kNone}, {kNone, 2, 0}};
  const Dim size = w.dim(2) * w.dim(3);
  Tensor out = Tensor::zeros(Shape{3, 3, w.dim(2), w.dim(3)});
  for (Dim i = 0; i < 3; ++i) {
    for (Dim j = 0; j < 3; ++j) {
      const Dim ky = kTaps[top][i], kx = kTaps[left][j];
      if (ky != kNone && kx != kNone)
        std::copy_n(w.value().data() + (4 * ky + kx) * size, size, out.data() + (3 * i + j) * size);
    }
  }
  return out;
}

}  // namespace

void Planner::conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.map;
  const bool same =
      s ==
      ConvSettings{
          .height = s.height, .width = s.width, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1};
  if (same && op.y.dim(op.y.rank() - 1) == 1) return plane_conv(op);
  same && !is_of_bytes(op) && is_of_tiles(op) ? winograd(op) : direct_conv(op);
}

void Planner::transposed_conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.map;
  const bool doubles = s == ConvSettings{.height = s.height,
                                         .width = s.width,
                                         .kernel_h = 4,
                                         .kernel_w = 4,
                                         .stride_h = 2,
                                         .stride_w = 2,
                                         .padding_h = 1,
                                         .padding_w = 1,
                                         .transposed = true};
  doubles && !is_of_bytes(op) && is_of_tiles(op) ? transposed_winograd(op) : direct_transposed_conv(op);
}

void Planner::winograd(const TracedOp& op) {
  const Map x = map_of(op.inputs[0]), y = new_map(op.y);
  Winograd step = winograd_step(op, x, y, y.strides());
  step.add(op.inputs[1].value(), 0, 0, step.side(), 0);
  plan_->scratch_ = std::max(plan_->scratch_, step.scratch());
  plan_->steps_.push_back(std::move(step));
}

// Each quarter of the outputs is a convolution with two by two of the three by three inputs around. The first
// point of Winograd's transform, 0, sees the first tap alone and the last, infinity, the last one: where
// these are 0, so is a row or a column of places.
void Planner::transposed_winograd(const TracedOp& op) {
  const Map x = map_of(op.inputs[0]), y = new_map(op.y);
  Winograd step = winograd_step(op, x, y, {y.image(), 2 * y.line(), 2 * y.channels});
  for (Dim top = 0; top < 2; ++top) {
    for (Dim left = 0; left < 2; ++left)
      step.add(quarter_weights(op.inputs[1], top, left), top, left, step.side() - 1,
               top * y.line() + left * y.channels);
  }
  plan_->scratch_ = std::max(plan_->scratch_, step.scratch());
  plan_->steps_.push_back(std::move(step));
}

}  // namespace supertac
