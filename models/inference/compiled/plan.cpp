#include "models/inference/compiled/plan.h"

#include <algorithm>

namespace supertac {

void Plan::clear_margins(const Block& block) const {
  for (const FeatureMap& map : planes_) std::fill_n(block.begin(map), map.image(), real(0));
  for (const FeatureMap& map : buffers_) fill_margin(map, block.images, real(0), block.begin(map));
}

void Plan::copy_out(const Block& block, const FeatureMap& map, Tensor& to, Dim first) const {
  const Dim run = map.width * map.channels;
  real* target = to.data() + first * map.height * run;
  for (Dim n = 0; n < block.images; ++n) {
    const real* line = block.first_pixel(map) + n * map.image();
    for (Dim y = 0; y < map.height; ++y, line += map.line(), target += run) std::copy_n(line, run, target);
  }
}

Estimate Plan::run(const Tensor& inputs) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  Estimate out{.picture = Tensor(Shape{count, picture_.height, picture_.width, 1}),
               .predicted_error = {},
               .latents = {}};
  if (predicted_error_) out.predicted_error = Tensor(out.picture.shape());
  if (latents_) out.latents = Tensor(Shape{count, latents_->channels});
  const Dim images = std::min(count, block_);
  Tensor memory(Shape{scratch_ + workspace_ * images});
  real* const workspace = memory.data() + scratch_;
  for (Dim first = 0; first < count; first += block_) {
    const Block block{inputs.data() + first * size, std::min(block_, count - first), workspace, memory.data(),
                      filters_anew_};
    if (first == 0 || block.images != block_) clear_margins(block);
    for (const PlanStep& step : steps_) step(block);
    copy_out(block, picture_, out.picture, first);
    if (predicted_error_) copy_out(block, *predicted_error_, out.predicted_error, first);
    if (latents_) copy_out(block, *latents_, out.latents, first);
  }
  return out;
}

}  // namespace supertac
