// The steps of a plan: each function packs its op's weights and adds what runs for a block of images. The
// table at the end has one for every op that networks draw with. Winograd's are in plan_winograd.cpp.
#include <array>

#include "autograd/kernels/exp.h"
#include "autograd/kernels/fast/each.h"
#include "autograd/kernels/shaping.h"
#include "models/inference/compiled/compiler.h"

namespace supertac {

static void input_step(Compiler& compiler, const TracedOp& op) {
  const FeatureMap y = compiler.new_map(op.y);
  const Dim size = op.inputs[0].size() / op.inputs[0].dim(0);
  const InputRuns runs = InputRuns::of(op);
  compiler.add_step([=](const Block& b) {
    for (Dim n = 0; n < b.images; ++n) {
      const real* from = b.input + n * size + runs.first;
      real* line = b.first_pixel(y) + n * y.image();
      for (Dim i = 0; i < y.height; ++i, line += y.line(), from += y.width * runs.step)
        for (Dim k = 0; k < y.channels; k += runs.run)
          kernels::move_columns(y.width, runs.run, from, {runs.step, k / runs.run * runs.apart},
                                {line, Into::overwrite}, {y.channels, k});
    }
  });
}

// [3][3][cin][1] -> [cin][column][row]
static Tensor plane_weights(const Variable& w) {
  const Dim cin = w.dim(2);
  Tensor out(Shape{cin, 3, 3});
  for (Dim c = 0; c < cin; ++c) {
    for (Dim k = 0; k < 9; ++k) out.data()[c * 9 + k % 3 * 3 + k / 3] = w.value().data()[k * cin + c];
  }
  return out;
}

// The planes of an image and the convolutions that look at them.
struct PlaneConvs {
  struct Output {
    kernels::PlaneOutput to;
    Tensor w;
    FeatureMap y;
  };
  kernels::PlaneJob job;
  FeatureMap x, planes;
  std::vector<Output> outputs;

  void operator()(const Block& block) const {
    real* const first = block.workspace + planes.offset * block.images;
    std::array<kernels::PlaneOutput, kMost> to;
    for (Dim n = 0; n < block.images; ++n) {
      isa().planes(job, x.line(), block.first_pixel(x) + n * x.image(), first + job.line + 1);
      for (std::size_t i = 0; i < outputs.size(); ++i) {
        to[i] = outputs[i].to;
        to[i].y = block.first_pixel(outputs[i].y) + n * outputs[i].y.image();
      }
      kernels::PlaneJob now = job;
      now.outputs = to.data(), now.output_count = static_cast<Dim>(outputs.size());
      isa().plane_conv(now, first);
    }
  }
  static constexpr std::size_t kMost = 2;  // picture and predicted error
};

void Compiler::plane_conv(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  PlaneConvs::Output output{{}, plane_weights(op.inputs[1]), y};
  output.to = {output.w.data(), op.inputs[2].value().data()[0], op.settings.negative_slope};
  PlaneConvs* last = plan_->steps_.empty() ? nullptr : plan_->steps_.back().target<PlaneConvs>();
  if (last != nullptr && last->x.offset == x.offset && last->outputs.size() < PlaneConvs::kMost)
    return last->outputs.push_back(std::move(output));
  const Dim vectors = (x.width + kernels::kWidestVector - 1) / kernels::kWidestVector;
  const Dim line = vectors * kernels::kWidestVector + 2;
  const FeatureMap planes = plan_->add_buffer({.height = x.channels * (x.height + 2), .width = line});
  plan_->planes_.push_back(planes);
  add_step(PlaneConvs{{.height = x.height, .width = x.width, .cin = x.channels, .line = line},
                      x,
                      planes,
                      {std::move(output)}});
}

// A product with its own copy of what its job points at.
struct Product {
  kernels::ProductJob job;
  ProductTaps taps;
  FeatureMap x, y;

  void operator()(const Block& block) const {
    kernels::ProductJob now = job;
    now.images = block.images;
    now.segments = taps.segments.data();
    now.segment_count = static_cast<Dim>(taps.segments.size());
    now.w = taps.w.data();
    now.bias = taps.bias.data();
    isa().product(now, block.first_pixel(x), block.first_pixel(y) + taps.y_offset);
  }
};

void Compiler::product(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  for (ProductTaps& taps : products_of(op, x, y)) {
    const kernels::ProductJob job{.height = taps.height,
                                  .width = taps.width,
                                  .from = taps.from,
                                  .to = taps.to,
                                  .length = taps.length,
                                  .cout = taps.bias.size(),
                                  .negative_slope = op.settings.negative_slope};
    add_step(Product{job, std::move(taps), x, y});
  }
}

static void unflatten_step(Compiler& compiler, const TracedOp& op) {
  const FeatureMap x = compiler.map_of(op.inputs[0]), y = compiler.new_map(op.y);
  compiler.add_step([=](const Block& b) {
    const Dim run = y.width * y.channels;
    for (Dim n = 0; n < b.images; ++n) {
      kernels::move_columns(y.height, run, b.begin(x) + n * x.image(), {run, 0},
                            {b.first_pixel(y) + n * y.image(), Into::overwrite}, {y.line(), 0});
    }
  });
}

static void concat_step(Compiler& compiler, const TracedOp& op) {
  if (op.y.rank() > 2) throw std::logic_error("CompiledModel: a concat of maps has no step");
  const FeatureMap y = compiler.new_map(op.y);
  Dim at = 0;
  for (const Variable& input : op.inputs) {
    const FeatureMap x = compiler.map_of(input);
    compiler.add_step([=](const Block& b) {
      kernels::move_columns(b.images, x.channels, b.begin(x), {x.channels, 0}, {b.begin(y), Into::overwrite},
                            {y.channels, at});
    });
    at += x.channels;
  }
}

static void global_mean_step(Compiler& compiler, const TracedOp& op) {
  const FeatureMap x = compiler.map_of(op.inputs[0]), y = compiler.new_map(op.y);
  compiler.add_step([=](const Block& b) {
    isa().mean({b.images, x.height, x.width, x.channels, {}, x.strides(), {}}, b.first_pixel(x), b.begin(y));
  });
}

static void sigmoid_step(Compiler& compiler, const TracedOp& op) {
  const FeatureMap x = compiler.map_of(op.inputs[0]), y = compiler.new_map(op.y);
  if (op.y.rank() > 2) throw std::logic_error("CompiledModel: a sigmoid of maps has no step");
  compiler.add_step([=](const Block& b) {
    kernels::each(b.images * x.image(), [from = b.begin(x), to = b.begin(y)](Dim i) {
      to[i] = kernels::sigmoid_same_bits(from[i]);
    });
  });
}

// a + gates * x, or a + x.
static void sum_step(Compiler& compiler, const TracedOp& op) {
  const FeatureMap a = compiler.map_of(op.inputs[0]), x = compiler.map_of(op.inputs[1]);
  const bool gated = op.inputs.size() == 3;
  const FeatureMap gates = gated ? compiler.map_of(op.inputs[2]) : FeatureMap();
  const FeatureMap y = compiler.new_map(op.y);
  compiler.add_step([=](const Block& b) {
    isa().gate({b.images, x.height, x.width, x.channels, a.strides(), x.strides(), y.strides()},
               b.first_pixel(a), b.first_pixel(x), gated ? b.begin(gates) : nullptr, b.first_pixel(y));
  });
}

const std::map<std::string_view, Compiler::Make>& Compiler::makers() {
  static constexpr Make make_conv = [](Compiler& compiler, const TracedOp& op) { compiler.conv(op); };
  static const std::map<std::string_view, Make> known{
      {"take_runs", input_step},
      {"last_frame", input_step},
      {"conv1d", make_conv},
      {"conv2d", make_conv},
      {"conv_transpose1d", make_conv},
      {"conv_transpose2d", make_conv},
      {"linear", [](Compiler& compiler, const TracedOp& op) { compiler.product(op); }},
      {"flatten_channels_first", [](Compiler&, const TracedOp&) {}},  // a linear layer takes the map as it is
      {"unflatten_channels_first", unflatten_step},
      {"concat", concat_step},
      {"global_mean", global_mean_step},
      {"sigmoid", sigmoid_step},
      {"gated_sum", sum_step},
      {"add", sum_step},
  };
  return known;
}

}  // namespace supertac
