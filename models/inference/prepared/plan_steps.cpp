// The steps of models/inference/prepared/planner.h: each packs its op's weights and returns what runs for a
// block of images.
#include <algorithm>
#include <array>

#include "autograd/kernels/elementwise.h"
#include "models/inference/prepared/planner.h"

namespace supertac {

void Planner::last_frame(const TracedOp& op) {
  const FeatureMap y = new_map(op.y);
  const Dim frame = op.inputs[0].dim(2), window = op.inputs[0].dim(1) * frame;
  plan_->steps_.push_back([=](const Block& b) {
    for (Dim n = 0; n < b.images; ++n) {
      const real* from = b.input + (n + 1) * window - frame;
      real* line = b.first_pixel(y) + n * y.image();
      for (Dim i = 0; i < y.height; ++i, line += y.line(), from += y.width * y.channels)
        std::copy_n(from, y.width * y.channels, line);
    }
  });
}

template <Dim kRun>
static void copy_runs(Dim rows, const real* from, Dim from_step, real* to, Dim to_step) {
  for (Dim r = 0; r < rows; ++r, from += from_step, to += to_step) std::copy_n(from, kRun, to);
}

void Planner::take_runs(const TracedOp& op) {
  const FeatureMap y = new_map(op.y);
  const Dim width = op.inputs[0].dim(2), rows = y.width;
  const OpSettings s = op.settings;
  const Dim piece = s.run % 4 == 0 ? 4 : 1;  // a row of the rig's array is one move
  plan_->steps_.push_back([=](const Block& b) {
    for (Dim n = 0; n < b.images; ++n) {
      const real* from = b.input + n * rows * width + s.first;
      real* to = b.first_pixel(y) + n * y.image();
      for (Dim k = 0; k < y.channels; k += piece) {
        (piece == 4 ? copy_runs<4> : copy_runs<1>)(rows, from + k / s.run * s.step + k % s.run, width, to + k,
                                                   y.channels);
      }
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

void Planner::plane_conv(const TracedOp& op) {
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
  plan_->steps_.push_back(PlaneConvs{{.height = x.height, .width = x.width, .cin = x.channels, .line = line},
                                     x,
                                     planes,
                                     {std::move(output)}});
}

void Planner::flatten(const TracedOp&) {}  // the linear layer behind it takes the map as it is

void Planner::unflatten(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  plan_->steps_.push_back([=](const Block& b) {
    const Dim run = y.width * y.channels;
    for (Dim n = 0; n < b.images; ++n) {
      const real* from = b.begin(x) + n * x.image();
      real* line = b.first_pixel(y) + n * y.image();
      for (Dim i = 0; i < y.height; ++i, from += run, line += y.line()) std::copy_n(from, run, line);
    }
  });
}

void Planner::concat(const TracedOp& op) {
  if (op.y.rank() > 2) throw std::logic_error("Prepared: a concat of maps has no step");
  const FeatureMap y = new_map(op.y);
  Dim at = 0;
  for (const Variable& input : op.inputs) {
    const FeatureMap x = map_of(input);
    plan_->steps_.push_back([=](const Block& b) {
      for (Dim n = 0; n < b.images; ++n)
        std::copy_n(b.begin(x) + n * x.channels, x.channels, b.begin(y) + n * y.channels + at);
    });
    at += x.channels;
  }
}

void Planner::global_mean(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  plan_->steps_.push_back([=](const Block& b) {
    isa().mean({b.images, x.height, x.width, x.channels, {}, x.strides(), {}}, b.first_pixel(x), b.begin(y));
  });
}

void Planner::sigmoid(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  if (op.y.rank() > 2) throw std::logic_error("Prepared: a sigmoid of maps has no step");
  plan_->steps_.push_back(
      [=](const Block& b) { kernels::sigmoid(b.images * x.image(), b.begin(x), b.begin(y)); });
}

void Planner::gated_sum(const TracedOp& op) {
  const FeatureMap a = map_of(op.inputs[0]), x = map_of(op.inputs[1]), gates = map_of(op.inputs[2]);
  const FeatureMap y = new_map(op.y);
  plan_->steps_.push_back([=](const Block& b) {
    isa().gate({b.images, x.height, x.width, x.channels, a.strides(), x.strides(), y.strides()},
               b.first_pixel(a), b.first_pixel(x), b.begin(gates), b.first_pixel(y));
  });
}

void Planner::add(const TracedOp& op) {
  const FeatureMap a = map_of(op.inputs[0]), x = map_of(op.inputs[1]), y = new_map(op.y);
  plan_->steps_.push_back([=](const Block& b) {
    isa().gate({b.images, x.height, x.width, x.channels, a.strides(), x.strides(), y.strides()},
               b.first_pixel(a), b.first_pixel(x), nullptr, b.first_pixel(y));
  });
}

}  // namespace supertac
