#include "autograd/kernels/fast/weight_forms.h"

#include <exception>

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

// By turns, so that a thread asks its pool for the same blocks in every step.
void WeightForms::renew() {
  std::exception_ptr error;  // one that must not leave a thread: no memory
#pragma omp parallel for schedule(static, 1)
  for (Slot* slot : all_) {
    try {
      if (slot->make) slot->make(slot->values.data());
    } catch (...) {
#pragma omp critical
      error = std::current_exception();
    }
  }
  if (error) std::rethrow_exception(error);
}

WeightForms::Slot* WeightForms::slot_of(const real* weights, WeightForm form) {
  const auto found = slots_.find(weights);
  return found == slots_.end() ? nullptr : found->second[static_cast<std::size_t>(form)].get();
}

WeightForms::Use::Use(WeightForms& forms) { used_here = &forms; }
WeightForms::Use::~Use() { used_here = nullptr; }
WeightForms* WeightForms::in_use() { return used_here; }

}  // namespace supertac::kernels
