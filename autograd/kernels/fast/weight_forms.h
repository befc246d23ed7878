// The forms that kernels bring weights into before they use them: transposed (transposed_weights()),
// Winograd's filters G g G^T, and those of the turned kernels, for the gradient of x.
//
// A kernel makes them anew in every call, as it cannot know whether the weights have changed. In a training
// step they are constant while its micro-batches run, so each form need be made only once for all of them.
// In the first step the thread that asks first makes it. Before every later step all threads share this work,
// so that none waits for another within the step.
#pragma once

#include <array>
#include <functional>
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
  /// For these weights, whose buffers it keeps alive.
  explicit WeightForms(const std::vector<Tensor>& weights);
  /// To be called after the weights were written and before they are used: makes the forms anew that were
  /// asked for so far. Not while a Use lives.
  void renew();

  struct Slot {
    std::mutex making;
    Tensor values;  // once asked for
    std::function<void(real*)> make;
  };
  /// Null for other weights than these.
  Slot* slot_of(const real* weights, WeightForm form);

  /// While one lives the kernels of this thread take the forms, and the weights must not be written.
  class Use {
   public:
    explicit Use(WeightForms& forms);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
  };
  /// The forms in use on this thread, or null.
  static WeightForms* in_use();

 private:
  std::vector<Tensor> weights_;  // keeps their buffers from being given to anything else
  std::unordered_map<const real*, std::array<std::unique_ptr<Slot>, kWeightForms>> slots_;
  std::vector<Slot*> all_;
};

/// The form of these weights; make(real* to) writes it unless it is in use and made already. What `make`
/// refers to must live as long as the weights.
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
  if (!slot->values.defined()) {
    slot->values = Tensor(shape);
    slot->make = make;
    make(slot->values.data());
  }
  return slot->values;
}

}  // namespace supertac::kernels
