#include "models/inference/compiled/taps.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

namespace supertac {

using kernels::ConvSettings;

static Dim reach(Dim size, Dim out, Dim kernel, Dim stride, Dim padding, bool transposed) {
  const Dim before = transposed ? (kernel - 1 - padding + stride - 1) / stride : padding;
  const Dim last = transposed ? (out - 1 + padding) / stride : (out - 1) * stride + kernel - 1 - padding;
  return std::max<Dim>({0, before, last - (size - 1)});
}

void Margin::widen(const ConvSettings& s) {
  height =
      std::max(height, reach(s.height, s.out_height(), s.kernel_h, s.stride_h, s.padding_h, s.transposed));
  width = std::max(width, reach(s.width, s.out_width(), s.kernel_w, s.stride_w, s.padding_w, s.transposed));
}

// The outputs first, first + stride, ... of a transposed convolution along one axis: output first + stride t
// sees the inputs t + base - j through the taps tap + stride j, j = taps - 1 ... 0.
struct AxisPhase {
  AxisPhase(Dim first, Dim out, Dim kernel, Dim stride, Dim padding)
      : count((out - first + stride - 1) / stride),
        tap((first + padding) % stride),
        base((first + padding) / stride),
        taps(tap < kernel ? (kernel - tap + stride - 1) / stride : 0) {}
  Dim count, tap, base, taps;
};

// [ky][kx][cin][cout] -> the taps of these phases in the order of their inputs.
static Tensor phase_weights(const ConvSettings& s, const AxisPhase& v, const AxisPhase& h,
                            const Variable& w) {
  const Dim size = w.dim(w.rank() - 2) * w.dim(w.rank() - 1);
  Tensor out(Shape{v.taps * h.taps, size});
  real* to = out.data();
  for (Dim jy = v.taps - 1; jy >= 0; --jy) {
    for (Dim jx = h.taps - 1; jx >= 0; --jx, to += size) {
      const Dim tap = (v.tap + s.stride_h * jy) * s.kernel_w + h.tap + s.stride_w * jx;
      std::copy_n(w.value().data() + tap * size, size, to);
    }
  }
  return out;
}

// The weights of a linear layer behind flatten_channels_first or before unflatten_channels_first,
// [outer][channels][pixels][inner], take the numbers in the order in which they lie,
// [outer][pixels][channels][inner].
static Tensor with_pixels_outside(const Tensor& t, Dim outer, Dim pixels, Dim inner) {
  if (pixels == 1) return t.clone();
  Tensor out(t.shape());
  const Dim channels = t.size() / (outer * pixels * inner);
  real* to = out.data();
  for (Dim a = 0; a < outer; ++a) {
    for (Dim p = 0; p < pixels; ++p) {
      for (Dim c = 0; c < channels; ++c, to += inner)
        std::copy_n(t.data() + ((a * channels + c) * pixels + p) * inner, inner, to);
    }
  }
  return out;
}

static ProductTaps conv(const TracedOp& op, const FeatureMap& x, const FeatureMap& y) {
  const ConvSettings& s = op.settings.conv;
  ProductTaps taps{.height = y.height,
                   .width = y.width,
                   .from = {x.image(), s.stride_h * x.line(), s.stride_w * x.channels},
                   .to = y.strides(),
                   .length = s.kernel_w * x.channels,
                   .w = op.inputs[1].value().clone(),
                   .bias = op.inputs[2].value().clone()};
  for (Dim ky = 0; ky < s.kernel_h; ++ky)
    taps.segments.push_back((ky - s.padding_h) * x.line() - s.padding_w * x.channels);
  return taps;
}

static std::vector<ProductTaps> transposed_conv(const TracedOp& op, const FeatureMap& x,
                                                const FeatureMap& y) {
  const ConvSettings& s = op.settings.conv;
  std::vector<ProductTaps> products;
  for (Dim top = 0; top < s.stride_h; ++top) {
    for (Dim left = 0; left < s.stride_w; ++left) {
      const AxisPhase v(top, y.height, s.kernel_h, s.stride_h, s.padding_h);
      const AxisPhase h(left, y.width, s.kernel_w, s.stride_w, s.padding_w);
      if (v.count == 0 || h.count == 0) continue;
      ProductTaps taps{.height = v.count,
                       .width = h.count,
                       .from = x.strides(),
                       .to = {y.image(), s.stride_h * y.line(), s.stride_w * y.channels},
                       .length = h.taps * x.channels,
                       .y_offset = top * y.line() + left * y.channels,
                       .w = phase_weights(s, v, h, op.inputs[1]),
                       .bias = op.inputs[2].value().clone()};
      for (Dim jy = v.taps - 1; jy >= 0; --jy)
        taps.segments.push_back((v.base - jy) * x.line() + (h.base - h.taps + 1) * x.channels);
      products.push_back(std::move(taps));
    }
  }
  return products;
}

InputRuns InputRuns::of(const TracedOp& op) {
  const OpSettings& s = op.settings;
  if (op.op == "take_runs") return {s.first, s.run, s.step, op.inputs[0].dim(2)};
  const Dim channels = op.y.dim(3);
  return {(op.inputs[0].size() - op.y.size()) / op.y.dim(0), channels, 0, channels};
}

TraceWalk::TraceWalk(const TracedPrediction& traced) : input_(traced.input.node()) {
  const std::vector<TracedOp>& ops = traced.trace.ops();
  for (std::size_t i = 0; i < ops.size(); ++i) {
    const TracedOp& op = ops[i];
    if (op.op == "flatten_channels_first") flattened_[op.y.node()] = owner(op.inputs[0]);
    if (op.op == "unflatten_channels_first")
      pixels_of_unflatten_[op.inputs[0].node()] = op.inputs[0].dim(1) / op.y.dim(op.y.rank() - 1);
    if (op.op.starts_with("conv")) margins_[owner(op.inputs[0])].widen(op.settings.conv);
    for (const Variable& x : op.inputs) last_use_[owner(x)] = i;
  }
  for (const Variable* y : {&traced.drawn.picture, &traced.drawn.predicted_error, &traced.drawn.latents})
    if (y->defined()) last_use_[owner(*y)] = std::numeric_limits<std::size_t>::max();
}

TraceWalk::Id TraceWalk::owner(const Variable& x) const {
  const auto flattened = flattened_.find(x.node());
  return flattened == flattened_.end() ? x.node() : flattened->second;
}

FeatureMap TraceWalk::layout_of(const Variable& y) const {
  const auto margin = margins_.find(y.node());
  FeatureMap map{.channels = y.dim(y.rank() - 1)};
  if (margin != margins_.end()) map.margin_h = margin->second.height, map.margin_w = margin->second.width;
  if (y.rank() > 2) map.width = y.dim(y.rank() - 2);
  if (y.rank() > 3) map.height = y.dim(1);
  return map;
}

std::vector<ProductTaps> TraceWalk::products_of(const TracedOp& op, const FeatureMap& x,
                                                const FeatureMap& y) const {
  if (op.op == "linear") return {linear(op, x, y)};
  return op.settings.conv.transposed ? transposed_conv(op, x, y) : std::vector{conv(op, x, y)};
}

ProductTaps TraceWalk::linear(const TracedOp& op, const FeatureMap& x, const FeatureMap& y) const {
  if (x.height > 1 && x.margin_w > 0)
    throw std::logic_error("CompiledModel: a flattened picture has margins");
  const auto unflattened = pixels_of_unflatten_.find(op.y.node());
  const Dim pixels = unflattened == pixels_of_unflatten_.end() ? 1 : unflattened->second;
  const Dim in = op.inputs[0].dim(1), out = op.y.dim(1);
  const Tensor w = with_pixels_outside(op.inputs[1].value(), 1, in / x.channels, out);
  return {.from = {x.image(), 0, 0},
          .to = {y.image(), 0, 0},
          .segments = {0},
          .length = in,
          .w = with_pixels_outside(w, in, pixels, 1),
          .bias = with_pixels_outside(op.inputs[2].value(), 1, pixels, 1)};
}

bool TraceWalk::read_after(Id value, std::size_t op) const {
  const auto last = last_use_.find(value);
  return last != last_use_.end() && last->second > op;
}

bool TraceWalk::takes_input(const TracedOp& op) const {
  const bool takes = op.op == "take_runs" || op.op == "last_frame";
  if (takes != (op.inputs[0].node() == input_))
    throw std::logic_error("CompiledModel: " + std::string(op.op) + " has a step for " +
                           (takes ? "the network's input only" : "anything but the network's input"));
  return takes;
}

}  // namespace supertac
