#include "autograd/kernels/fast/weight_forms.h"

namespace supertac::kernels {
namespace {

thread_local WeightForms* used_here = nullptr;

}  // namespace

WeightForms::WeightForms(const std::vector<Tensor>& weights) : weights_(weights) {
  for (const Tensor& tensor : weights_)
    for (auto& slot : slots_[tensor.data()]) {
      slot = std::make_unique<Slot>();
      all_.push_back(slot.get());
    }
}

void WeightForms::renew() {
#pragma omp parallel for schedule(dynamic)
  for (Slot* slot : all_)
    if (slot->make) slot->make(slot->values.data());
}

WeightForms::Slot* WeightForms::slot_of(const real* weights, WeightForm form) {
  const auto found = slots_.find(weights);
  return found == slots_.end() ? nullptr : found->second[static_cast<std::size_t>(form)].get();
}

WeightForms::Use::Use(WeightForms& forms) { used_here = &forms; }
WeightForms::Use::~Use() { used_here = nullptr; }
WeightForms* WeightForms::in_use() { return used_here; }

}  // namespace supertac::kernels
