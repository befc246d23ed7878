// The steps of models/inference/prepared/planner.h that are products.

#include "models/inference/prepared/planner.h"

namespace supertac {

using kernels::ProductJob;

// A product with its own copy of what its job points at.
struct Product {
  ProductJob job;
  ProductTaps taps;
  FeatureMap x, y;

  void operator()(const Block& block) const {
    ProductJob now = job;
    now.images = block.images;
    now.segments = taps.segments.data();
    now.segment_count = static_cast<Dim>(taps.segments.size());
    now.w = taps.w.data();
    now.bias = taps.bias.data();
    isa().product(now, block.first_pixel(x), block.first_pixel(y) + taps.y_offset);
  }
};

void Planner::product(const TracedOp& op) {
  const FeatureMap x = map_of(op.inputs[0]), y = new_map(op.y);
  for (ProductTaps& taps : products_of(op, x, y)) {
    weights_ += bytes_of(taps.w);
    const ProductJob job{.height = taps.height,
                         .width = taps.width,
                         .from = taps.from,
                         .to = taps.to,
                         .length = taps.length,
                         .cout = taps.bias.size(),
                         .negative_slope = op.settings.negative_slope};
    add_step(Product{job, std::move(taps), x, y});
  }
}

}  // namespace supertac
