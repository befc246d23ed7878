#include "models/inference/compiled/compiled_model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "autograd/kernels/fast/isa/isa.h"
#include "autograd/kernels/fast/pool.h"
#include "autograd/record.h"
#include "models/inference/compiled/compiler.h"
#include "models/inference/compiled/integer_plan.h"

namespace supertac {

CompiledModel::CompiledModel(const SuperTac& network) : network_(&network) {
  if (!kernels::is_plain()) plan_ = Compiler::plan(network);
}

CompiledModel::CompiledModel(const SuperTac& network, const ActivationRanges& ranges)
    : network_(&network), integers_(IntegerPlan::of(network, ranges)) {}

Estimate CompiledModel::estimate(const Tensor& inputs) const {
  if (plan_ == nullptr && integers_ == nullptr) return network_->estimate(inputs);
  if (inputs.rank() < 1 || inputs.shape() != network_->input_shape(inputs.dim(0)))
    refuse("CompiledModel", "inputs", "[N" + network_->input_shape(0).text().substr(2),
           inputs.shape().text());
  const SuperTacSettings& settings = network_->settings();
  Estimate out;
  out.picture = Tensor(network_->picture_shape(inputs.dim(0)));
  if (settings.predicted_error) out.predicted_error = Tensor(out.picture.shape());
  if (settings.latents() > 0) out.latents = Tensor(Shape{inputs.dim(0), settings.latents()});
  integers_ ? integers_->run(inputs, out) : plan_->run(inputs, out);
  return out;
}

std::shared_ptr<const Plan> Compiler::plan(const SuperTac& network) {
  const TracedPrediction traced(network, Tensor::zeros(network.input_shape(1)));
  const Prediction& drawn = traced.drawn;
  Compiler compiler(traced);
  const std::pair<const Variable&, Tensor Estimate::*> outputs[] = {
      {drawn.picture, &Estimate::picture},
      {drawn.predicted_error, &Estimate::predicted_error},
      {drawn.latents, &Estimate::latents}};
  for (const auto& [y, to] : outputs)
    if (y.defined()) compiler.plan_->outputs_.emplace_back(compiler.map_of(y), to);
  return compiler.plan_;
}

Compiler::Compiler(const TracedPrediction& traced) : TraceWalk(traced) {
  const std::vector<TracedOp>& ops = traced.trace.ops();
  for (std::size_t i = 0; i < ops.size(); ++i) {
    const auto make = makers().find(ops[i].op);
    if (make == makers().end())
      throw std::logic_error("CompiledModel: no step computes the op " + std::string(ops[i].op) +
                             "; models/inference/compiled/plan_steps.cpp lists those that have one");
    takes_input(ops[i]);  // or throws
    make->second(*this, ops[i]);
    release_after(i);
  }
}

const FeatureMap& Compiler::map_of(const Variable& x) const { return maps_.at(owner(x)); }

FeatureMap Plan::add_buffer(FeatureMap layout) {
  constexpr Dim kLine = 64;  // a line of the cache in bytes
  layout.offset = workspace_;
  workspace_ += (layout.image() + kLine - 1) / kLine * kLine;
  return buffers_.emplace_back(layout);
}

// One of the free buffers with this layout, or a new one.
const FeatureMap& Compiler::new_map(const Variable& y) {
  const FeatureMap layout = layout_of(y);
  const auto old = std::ranges::find_if(free_, [&](const FeatureMap& m) { return m.same_layout(layout); });
  FeatureMap& map = maps_[y.node()] = old == free_.end() ? plan_->add_buffer(layout) : *old;
  if (old != free_.end()) free_.erase(old);
  return map;
}

void Compiler::release_after(std::size_t op) {
  std::erase_if(maps_, [&](const auto& value) {
    if (read_after(value.first, op)) return false;
    free_.push_back(value.second);
    return true;
  });
}

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

void Plan::run(const Tensor& inputs, Estimate& out) const {
  const Dim count = inputs.dim(0), size = count == 0 ? 0 : inputs.size() / count;
  const Dim images = std::min(count, kBlock);
  Tensor memory(Shape{scratch_ + workspace_ * images});
  real* const workspace = memory.data() + scratch_;
  for (Dim first = 0; first < count; first += kBlock) {
    const Block block{inputs.data() + first * size, std::min(kBlock, count - first), workspace,
                      memory.data()};
    if (first == 0 || block.images != kBlock) clear_margins(block);
    for (const PlanStep& step : steps_) step(block);
    for (const auto& [map, to] : outputs_) copy_out(block, map, out.*to, first);
  }
}

static double square(real x) { return static_cast<double>(x) * static_cast<double>(x); }

Ensemble::Ensemble(std::vector<CompiledModel> members) : members_(std::move(members)) {
  if (members_.empty()) refuse("Ensemble", "members", "one network or more", "none");
  for (const CompiledModel& member : members_)
    if (member.network().format() != first().format())
      refuse("Ensemble", "members", "networks of one format, " + text(first().format()),
             text(member.network().format()));
}

Estimate Ensemble::estimate(const Tensor& inputs) const {
  Estimate mean = members_.front().estimate(inputs);
  if (members_.size() == 1) return mean;
  const bool predicted_error = mean.predicted_error.defined();
  const auto count = static_cast<real>(members_.size());
  const auto pixels = static_cast<std::size_t>(mean.picture.size());
  const std::size_t errors = predicted_error ? pixels : 0;
  std::vector<double, PoolAllocator<double>> squares(errors);  // a picture takes no heap
  mean.picture = mean.picture.clone();
  for (std::size_t m = 0; m < members_.size(); ++m) {
    const Estimate one = m == 0 ? mean : members_[m].estimate(inputs);
    if (one.predicted_error.defined() != predicted_error)
      refuse("Ensemble", "members", "networks that all predict their error, or none", "some that do");
    for (std::size_t i = 0; i < errors; ++i)
      squares[i] += square(one.picture.values()[i]) + square(one.predicted_error.values()[i]);
    for (std::size_t i = 0; m > 0 && i < pixels; ++i) mean.picture.values()[i] += one.picture.values()[i];
  }
  for (real& value : mean.picture.values()) value /= count;
  if (!predicted_error) return mean;
  mean.predicted_error = Tensor(mean.picture.shape());
  for (std::size_t i = 0; i < pixels; ++i)
    mean.predicted_error.values()[i] =
        static_cast<real>(std::sqrt(std::max(0.0, squares[i] / count - square(mean.picture.values()[i]))));
  return mean;
}

}  // namespace supertac
