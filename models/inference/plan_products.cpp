// The steps of models/inference/planner.h that are products: of numbers, or of the bytes that stand for them.
#include <algorithm>
#include <cmath>
#include <optional>

#include "models/inference/planner.h"

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

namespace {

// The same product of bytes: weights with a step for each output, so that the largest is 127.
struct ByteProduct {
  kernels::ByteProductJob job;
  std::vector<Dim> segments;
  std::vector<kernels::BytePlaces> places;
  Tensor w;  // of bytes, from the beginning of a line of the cache
  std::vector<float> scale, bias;
  FeatureMap x;
  std::optional<FeatureMap> y, y_bytes;
  Dim x_offset = 0, y_offset = 0;

  /// For blocks of up to so many images.
  ByteProduct(const Product& p, Dim images, kernels::Steps from, kernels::Steps to);
  /// Numbers.
  Dim scratch() const {
    kernels::ByteProductJob one = job;
    one.segments = segments.data();
    one.segment_count = static_cast<Dim>(segments.size());
    return (job.images * kernels::reach_of(one).count * 2 + 3) / 4;
  }
  void operator()(const Block& block) const {
    kernels::ByteProductJob now = job;
    now.images = block.images;
    now.segments = segments.data();
    now.segment_count = static_cast<Dim>(segments.size());
    now.w = reinterpret_cast<const std::int8_t*>(w.data());
    now.places = places.data();
    now.place_count = static_cast<Dim>(places.size());
    now.outcome.scale = scale.data();
    now.outcome.bias = bias.data();
    now.scratch = reinterpret_cast<std::int16_t*>(block.scratch);
    kernels::byte_kernels().product(now, block.first_byte(x) + x_offset,
                                    y ? block.first_pixel(*y) + y_offset : nullptr,
                                    y_bytes ? block.first_byte(*y_bytes) + y_offset : nullptr);
  }
};

ByteProduct::ByteProduct(const Product& p, Dim images, kernels::Steps from, kernels::Steps to)
    : job{.images = images,
          .height = p.job.height,
          .width = p.job.width,
          .from = p.job.from,
          .to = p.job.to,
          .length = p.job.length,
          .cout = (p.job.cout + kernels::kByteOutputs - 1) / kernels::kByteOutputs * kernels::kByteOutputs,
          .kept = p.job.cout,
          .outcome = {.negative_slope = static_cast<float>(p.job.negative_slope), .steps = to}},
      segments(p.segments),
      places(places_of(job)),
      scale(static_cast<std::size_t>(p.job.cout)),
      bias(scale.size()),
      x(p.x),
      x_offset(p.x_offset),
      y_offset(p.y_offset) {
  constexpr double kLargest = 127;
  const Dim rows = p.job.length * static_cast<Dim>(p.segments.size());
  w = Tensor::zeros(Shape{(rows * job.cout + 3) / 4});
  auto* const bytes = reinterpret_cast<std::int8_t*>(w.data());
  for (Dim o = 0; o < p.job.cout; ++o) {
    double largest = 0;
    for (Dim k = 0; k < rows; ++k)
      largest = std::max(largest, static_cast<double>(std::abs(p.w.data()[k * p.job.cout + o])));
    const double step = largest > 0 ? largest / kLargest : 1;
    std::int64_t sum = 0;
    for (Dim k = 0; k < rows; ++k) {
      const long whole = std::lrint(static_cast<double>(p.w.data()[k * p.job.cout + o]) / step);
      const Dim at = (k / kernels::kQuad * job.cout + o) * kernels::kQuad + k % kernels::kQuad;
      bytes[at] = static_cast<std::int8_t>(whole);
      sum += whole;
    }
    const double unit = step * static_cast<double>(from.step);
    scale[static_cast<std::size_t>(o)] = static_cast<float>(unit);
    bias[static_cast<std::size_t>(o)] = static_cast<float>(static_cast<double>(p.bias.data()[o]) -
                                                           unit * static_cast<double>(sum * from.zero));
  }
}

}  // namespace

// As it is, or of bytes; y has been given its memory.
void Planner::add_product(const TracedOp& op, Product product) {
  const Id y = op.y.node();
  if (!is_of_bytes(op)) {
    weights_ += bytes_of(product.w);
    product.y = maps_.at(y);
    plan_->steps_.push_back(std::move(product));
    return;
  }
  const auto to = steps_.find(y);
  ByteProduct step(product, Plan::kByteBlock, steps_.at(owner(op.inputs[0])),
                   to == steps_.end() ? kernels::Steps{} : to->second);
  weights_ += bytes_of(step.w);
  plan_->scratch_ = std::max(plan_->scratch_, step.scratch());
  if (maps_.contains(y)) step.y = maps_.at(y);
  if (bytes_.contains(y)) step.y_bytes = bytes_.at(y);
  plan_->steps_.push_back(std::move(step));
}

// The memory of what a product makes: numbers, bytes or both.
FeatureMap Planner::new_results(const TracedOp& op) {
  const Id y = op.y.node();
  const bool bytes = is_of_bytes(op) && steps_.contains(y);
  if (bytes) new_bytes(op.y);
  return bytes && !read_as_numbers_.contains(y) ? bytes_.at(y) : new_map(op.y);
}

// Behind an op that makes numbers which are read as bytes.
void Planner::add_bytes(const TracedOp& op) {
  const Id id = op.y.node();
  if (!steps_.contains(id) || bytes_.contains(id)) return;
  const FeatureMap x = maps_.at(id), y = new_bytes(op.y);
  const kernels::Steps steps = steps_.at(id);
  plan_->steps_.push_back([=](const Block& b) {
    kernels::to_bytes({b.images, x.height, x.width * x.channels, x.strides(), y.strides(), steps},
                      b.first_pixel(x), b.first_byte(y));
  });
}

void Planner::direct_conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const FeatureMap x = source_of(op), y = new_results(op);
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
  add_product(op, std::move(step));
}

namespace {

// The outputs first, first + stride, ... of a transposed convolution along one axis: output first + stride t
// sees the inputs t + base - j through the taps tap + stride j.
struct Phase {
  Phase(Dim first, Dim out, Dim kernel, Dim stride, Dim padding)
      : count((out - first + stride - 1) / stride),
        tap((first + padding) % stride),
        base((first + padding) / stride),
        taps(tap < kernel ? (kernel - tap + stride - 1) / stride : 0) {}
  Dim count, tap, base, taps;
};

// [ky][kx][cin][cout] -> the taps of these phases in the order of their inputs
Tensor phase_weights(const ConvSettings& s, const Phase& v, const Phase& h, const Variable& w) {
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

}  // namespace

void Planner::direct_transposed_conv(const TracedOp& op) {
  const ConvSettings& s = op.settings.conv;
  const FeatureMap x = source_of(op), y = new_results(op);
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
      add_product(op, std::move(step));
    }
  }
}

// The weights of a linear layer behind flatten_channels_first or before unflatten_channels_first take the
// numbers in the order in which they lie.
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

void Planner::linear(const TracedOp& op) {
  const FeatureMap x = source_of(op), y = new_results(op);
  const Dim in = op.inputs[0].dim(1), out = op.y.dim(1);
  if (x.height > 1 && x.margin_w > 0) throw std::logic_error("Prepared: a flattened picture has margins");
  const auto unflatten = pixels_of_unflatten_.find(op.y.node());
  const Dim pixels = unflatten == pixels_of_unflatten_.end() ? 1 : unflatten->second;
  const Tensor w = with_pixels_outside(op.inputs[1].value(), 1, in / x.channels, out);
  add_product(op, Product{.job = {.from = {x.image(), 0, 0},
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
