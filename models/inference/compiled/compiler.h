// Makes a Plan of the ops that one inference ran.
#pragma once

#include <map>
#include <memory>
#include <string_view>

#include "autograd/kernels/fast/isa/isa.h"
#include "models/inference/compiled/plan.h"

namespace supertac {

/// What the steps run on.
inline const kernels::IsaKernels& isa() { return kernels::isa_kernels(); }

/// One step for each op, in the order in which they ran; a map's memory is reused behind its last reader.
class Compiler : TraceWalk {
 public:
  /// Throws std::logic_error naming an op that has no step. `second_cache`: of the processor, in bytes; 0:
  /// not known.
  static std::shared_ptr<const Plan> plan(const SuperTac& network,
                                          std::size_t second_cache = second_cache_bytes());

  // For the steps.
  const FeatureMap& map_of(const Variable& x) const;
  const FeatureMap& new_map(const Variable& y);
  void add_step(PlanStep step) { plan_->steps_.push_back(std::move(step)); }

 private:
  using Make = void (*)(Compiler&, const TracedOp&);

  static std::size_t second_cache_bytes();
  static std::size_t bytes_of(const Tensor& t) { return static_cast<std::size_t>(t.size()) * sizeof(real); }
  bool filters_anew(std::size_t second_cache) const;
  explicit Compiler(const TracedPrediction& traced);
  /// In plan_steps.cpp: what makes the step of each op.
  static const std::map<std::string_view, Make>& makers();

  void add_winograd(struct Winograd step);
  void release_after(std::size_t op);

  void conv(const TracedOp& op);
  void winograd(const TracedOp& op);
  void plane_conv(const TracedOp& op);
  void product(const TracedOp& op);
  void transposed_conv(const TracedOp& op);
  void transposed_winograd(const TracedOp& op);

  std::shared_ptr<Plan> plan_ = std::make_shared<Plan>();
  std::map<Id, FeatureMap> maps_;
  std::vector<FeatureMap> free_;
  std::size_t weights_ = 0, transformed_ = 0;  // bytes: as they are, and Winograd's places of some of them
};

}  // namespace supertac
