#include "models/inference/prepared/taps.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

namespace supertac {

static Dim reach(Dim size, Dim out, Dim kernel, Dim stride, Dim padding, bool transposed) {
  const Dim before = transposed ? (kernel - 1 - padding + stride - 1) / stride : padding;
  const Dim last = transposed ? (out - 1 + padding) / stride : (out - 1) * stride + kernel - 1 - padding;
  return std::max<Dim>({0, before, last - (size - 1)});
}

void Margin::widen(const kernels::ConvSettings& s) {
  height =
      std::max(height, reach(s.height, s.out_height(), s.kernel_h, s.stride_h, s.padding_h, s.transposed));
  width = std::max(width, reach(s.width, s.out_width(), s.kernel_w, s.stride_w, s.padding_w, s.transposed));
}

Tensor phase_weights(const kernels::ConvSettings& s, const Phase& v, const Phase& h, const Variable& w) {
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

Tensor with_pixels_outside(const Tensor& t, Dim outer, Dim pixels, Dim inner) {
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

TraceWalk::TraceWalk(const Variable& input, const std::vector<TracedOp>& ops, const Drawing& drawn)
    : input_(input.node()) {
  for (std::size_t i = 0; i < ops.size(); ++i) {
    const TracedOp& op = ops[i];
    if (op.op == "flatten_channels_first") flattened_[op.y.node()] = owner(op.inputs[0]);
    if (op.op == "unflatten_channels_first")
      pixels_of_unflatten_[op.inputs[0].node()] = op.inputs[0].dim(1) / op.y.dim(op.y.rank() - 1);
    if (op.op.starts_with("conv")) margins_[owner(op.inputs[0])].widen(op.settings.conv);
    for (const Variable& x : op.inputs) last_use_[owner(x)] = i;
  }
  for (const Variable* y : {&drawn.picture, &drawn.predicted_error, &drawn.latents})
    if (y->defined()) last_use_[owner(*y)] = std::numeric_limits<std::size_t>::max();
}

TraceWalk::Id TraceWalk::owner(const Variable& x) const {
  const auto flattened = flattened_.find(x.node());
  return flattened == flattened_.end() ? x.node() : flattened->second;
}

Margin TraceWalk::margin_of(const Variable& y) const {
  const auto found = margins_.find(y.node());
  return found == margins_.end() ? Margin{} : found->second;
}

Dim TraceWalk::pixels_of_unflatten(const Variable& y) const {
  const auto found = pixels_of_unflatten_.find(y.node());
  return found == pixels_of_unflatten_.end() ? 1 : found->second;
}

bool TraceWalk::read_after(Id value, std::size_t op) const {
  const auto last = last_use_.find(value);
  return last != last_use_.end() && last->second > op;
}

bool TraceWalk::takes_input(const TracedOp& op) const {
  const bool takes = op.op == "take_runs" || op.op == "last_frame";
  if (takes != (op.inputs[0].node() == input_))
    throw std::logic_error("Prepared: " + std::string(op.op) + " has a step for " +
                           (takes ? "the network's input only" : "anything but the network's input"));
  return takes;
}

}  // namespace supertac
