// The steps of a compiled model, the memory that they work on, and what makes them of the ops that one
// inference ran. Plan and Compiler are in compiled_model.cpp; plan_steps.cpp and plan_winograd.cpp make the
// step of each op.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "autograd/kernels/fast/inference.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/inference/compiled/taps.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// What the steps run on.
inline const kernels::IsaKernels& isa() { return kernels::isa_kernels(); }

/// One block of images on its way through the steps.
struct Block {
  const real* input = nullptr;
  Dim images = 0;
  real* workspace = nullptr;
  real* scratch = nullptr;  ///< of the step that runs

  real* begin(const FeatureMap& map) const { return workspace + map.offset * images; }
  real* first_pixel(const FeatureMap& map) const { return begin(map) + map.origin(); }
};

using PlanStep = std::function<void(const Block&)>;

/// What runs: the steps of a network, and where its maps lie. The steps hold their weights. Memory is planned
/// for one image; a block of n images has n of each map, one behind the other, and every run takes its own.
class Plan {
 public:
  /// Draws what `out` has room for. Inputs as SuperTac::estimate(), which is not checked.
  void run(const Tensor& inputs, Estimate& out) const;

 private:
  friend class Compiler;
  FeatureMap add_buffer(FeatureMap layout);
  void clear_margins(const Block& block) const;
  void copy_out(const Block& block, const FeatureMap& map, Tensor& to, Dim first) const;

  /// Images that go through the steps together: they share the weights on their way from memory, but what
  /// they leave behind must stay in the second cache.
  static constexpr Dim kBlock = 8;

  std::vector<PlanStep> steps_;
  std::vector<FeatureMap> buffers_;  // each once
  std::vector<FeatureMap> planes_;   // those with margins inside: of one image, channel by channel
  Dim workspace_ = 0;                // numbers of an image, in all maps
  Dim scratch_ = 0;                  // numbers, of the step that needs the most
  std::vector<std::pair<FeatureMap, Tensor Estimate::*>> outputs_;
};

/// The steps of the ops, in the order in which they ran (most ops have one); a map's memory is reused behind
/// its last reader.
class Compiler : TraceWalk {
 public:
  /// Throws std::logic_error naming an op that has no step.
  static std::shared_ptr<const Plan> plan(const SuperTac& network);

  // For the steps: where x lies, and a place for y in memory that no later op reads.
  const FeatureMap& map_of(const Variable& x) const;
  const FeatureMap& new_map(const Variable& y);
  void add_step(PlanStep step) { plan_->steps_.push_back(std::move(step)); }

 private:
  using Make = void (*)(Compiler&, const TracedOp&);

  explicit Compiler(const TracedPrediction& traced);
  /// In plan_steps.cpp: what makes the step of each op.
  static const std::map<std::string_view, Make>& makers();

  void release_after(std::size_t op);

  void conv(const TracedOp& op);
  void winograd(const TracedOp& op);
  void plane_conv(const TracedOp& op);
  void product(const TracedOp& op);

  std::shared_ptr<Plan> plan_ = std::make_shared<Plan>();
  std::map<Id, FeatureMap> maps_;
  std::vector<FeatureMap> free_;
};

}  // namespace supertac
