#include "autograd/kernels/fast/weight_forms.h"

namespace supertac::kernels {
namespace {

thread_local WeightForms* used_here = nullptr;

}  // namespace

WeightForms::WeightForms(const std::vector<Tensor>& weights) : weights_(weights) {
  for (const Tensor& tensor : weights_)
    for (auto& slot : slots_[tensor.data()]) slot = std::make_unique<Slot>();
}

void WeightForms::renew() {
  std::vector<Slot*> asked_for;
  for (auto& [weights, slots] : slots_)
    for (const auto& slot : slots)
      if (slot->make) asked_for.push_back(slot.get());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < asked_for.size(); ++i) asked_for[i]->make(asked_for[i]->values.data());
}

WeightForms::Slot* WeightForms::slot_of(const real* weights, WeightForm form) {
  const auto found = slots_.find(weights);
  return found == slots_.end() ? nullptr : found->second[static_cast<std::size_t>(form)].get();
}

WeightForms::Use::Use(WeightForms& forms) { used_here = &forms; }
WeightForms::Use::~Use() { used_here = nullptr; }
WeightForms* WeightForms::in_use() { return used_here; }

}  // namespace supertac::kernels
