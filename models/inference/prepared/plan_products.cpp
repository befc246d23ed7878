// The steps of models/inference/prepared/planner.h that are products.

#include "models/inference/prepared/planner.h"
#include "models/inference/prepared/taps.h"

namespace supertac {

using kernels::ConvSettings;
using kernels::ProductJob;

// A product with its own copy of what its job points at.
struct Product {
  ProductJob job;
  std::vector<Dim> segments;
  Tensor w, bias;
  FeatureMap x, y;
  Dim x_offset = 0, y_offset = 0;  // from the maps' first pixels

  void operator()(const Block& block) const {
    ProductJob now = job;
    now.images = block.images;
    now.segments = segments.data();
    now.segment_count = static_cast<Dim>(segments.size());
    now.w = w.data();
    now.bias = bias.data();
    isa().product(now, block.first_pixel(x) + x_offset, block.first_pixel(y) + y_offset);
  }
};

void Planner::add_product(Product product) {
  weights_ += bytes_of(product.w);
  add_step(std::move(product));
}

void Planner::direct_conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  Product step{.job = {.height = y.height,
                       .width = y.width,
                       .from = {x.image(), s.stride_h * x.line(), s.stride_w * x.channels},
                       .to = y.strides(),
                       .length = s.kernel_w * x.channels,
                       .cout = y.channels,
                       .negative_slope = op.settings.negative_slope},
               .segments = {},
               .w = op.inputs[1].value().clone(),
               .bias = op.inputs[2].value().clone(),
               .x = x,
               .y = y};
  for (Dim ky = 0; ky < s.kernel_h; ++ky)
    step.segments.push_back((ky - s.padding_h) * x.line() - s.padding_w * x.channels);
  add_product(std::move(step));
}

void Planner::direct_transposed_conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  for (Dim top = 0; top < s.stride_h; ++top) {
    for (Dim left = 0; left < s.stride_w; ++left) {
      const Phase v(top, y.height, s.kernel_h, s.stride_h, s.padding_h);
      const Phase h(left, y.width, s.kernel_w, s.stride_w, s.padding_w);
      if (v.count == 0 || h.count == 0) continue;
      Product step{.job = {.height = v.count,
                           .width = h.count,
                           .from = x.strides(),
                           .to = {y.image(), s.stride_h * y.line(), s.stride_w * y.channels},
                           .length = h.taps * x.channels,
                           .cout = y.channels,
                           .negative_slope = op.settings.negative_slope},
                   .segments = {},
                   .w = phase_weights(s, v, h, op.inputs[1]),
                   .bias = op.inputs[2].value().clone(),
                   .x = x,
                   .y = y,
                   .y_offset = top * y.line() + left * y.channels};
      for (Dim jy = v.taps - 1; jy >= 0; --jy)
        step.segments.push_back((v.base - jy) * x.line() + (h.base - h.taps + 1) * x.channels);
      add_product(std::move(step));
    }
  }
}

void Planner::linear(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  const Dim in = op.inputs[0].dim(1), out = op.y.dim(1);
  if (x.height > 1 && x.margin_w > 0) throw std::logic_error("Prepared: a flattened picture has margins");
  const Dim pixels = pixels_of_unflatten(op.y);
  const Tensor w = with_pixels_outside(op.inputs[1].value(), 1, in / x.channels, out);
  add_product(Product{.job = {.from = {x.image(), 0, 0},
                              .to = {y.image(), 0, 0},
                              .length = in,
                              .cout = out,
                              .negative_slope = op.settings.negative_slope},
                      .segments = {0},
                      .w = with_pixels_outside(w, in, pixels, 1),
                      .bias = with_pixels_outside(op.inputs[2].value(), 1, pixels, 1),
                      .x = x,
                      .y = y});
}

}  // namespace supertac
