// What the kernels make of weights before they use them: transposed, turned, transformed for Winograd.
//
// A kernel makes them anew in every call, as it cannot know whether somebody wrote the weights meanwhile. A
// training step knows: its weights stand still while its micro-batches run, so each form need be made once
// for all of them.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "autograd/tensor.h"

namespace supertac::kernels {

enum class WeightForm { transposed, filters, turned_filters };
inline constexpr std::size_t kWeightForms = 3;

/// The forms of the weights of one model, each made when it is first asked for.
class WeightForms {
 public:
  /// Of weights whose buffers stay where they are. What other weights there are is unknown to it.
  explicit WeightForms(const std::vector<Tensor>& weights);
  /// To be called after the weights were written and before they are used. Not while a Use lives.
  void forget();

  struct Slot {
    std::mutex making;
    bool made = false;
    Tensor values;
  };
  Slot* slot_of(const real* weights, WeightForm form);

  /// While one lives the kernels of this thread take the forms, and nobody may write the weights.
  class Use {
   public:
    explicit Use(WeightForms& forms);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
  };
  /// Of this thread, or null.
  static WeightForms* in_use();

 private:
  std::vector<Tensor> weights_;  // keeps their buffers from being given to anything else
  std::unordered_map<const real*, std::array<std::unique_ptr<Slot>, kWeightForms>> slots_;
};

/// The form of these weights, which make(real* to) writes where it is not there yet.
template <class Make>
Tensor weight_form(const real* weights, WeightForm form, const Shape& shape, Make make) {
  WeightForms* forms = WeightForms::in_use();
  WeightForms::Slot* slot = forms != nullptr ? forms->slot_of(weights, form) : nullptr;
  if (slot == nullptr) {
    Tensor values(shape);
    make(values.data());
    return values;
  }
  const std::lock_guard lock(slot->making);
  if (!slot->values.defined()) slot->values = Tensor(shape);
  if (!slot->made) make(slot->values.data());
  slot->made = true;
  return slot->values;
}

}  // namespace supertac::kernels
