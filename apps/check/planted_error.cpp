#include "apps/check/planted_error.h"

#include <algorithm>

namespace supertac {
namespace {

// What the reverse step adds to the gradient of one input, as a tensor of its own; the gradient itself is put
// back to what it was.
Tensor added_by(const std::function<void()>& step, Tensor& gradient) {
  const Tensor before = gradient.clone();
  step();
  Tensor added = gradient.clone();
  for (Dim i = 0; i < added.size(); ++i) added.data()[i] -= before.data()[i];
  std::copy_n(before.data(), before.size(), gradient.data());
  return added;
}

void spoil(Plant::Kind kind, Tensor& added) {
  if (kind == Plant::Kind::index) {
    std::rotate(added.data(), added.data() + added.size() - 1, added.data() + added.size());
    return;
  }
  const real factor = kind == Plant::Kind::sign ? -1 : 2;
  for (real& g : added.values()) g *= factor;
}

}  // namespace

std::string name_of(Plant::Kind kind) {
  static constexpr const char* kNames[] = {"sign", "factor", "term", "index"};
  return kNames[static_cast<std::size_t>(kind)];
}

void PlantedError::reverse(const char* op, std::size_t inputs, Backward& b,
                           const std::function<void()>& step) {
  Tensor* gradient = plant_.op == op && plant_.input < inputs ? b.grad_of(plant_.input) : nullptr;
  if (gradient == nullptr || gradient->size() == 0) return step();
  // The step runs twice: as it is for the other inputs, then once more for this one alone.
  std::vector<Tensor> others(inputs);
  const Tensor gy = b.gy().clone();
  const Tensor right = added_by(step, *gradient);
  for (std::size_t i = 0; i < inputs; ++i) {
    if (const Tensor* g = b.grad_of(i); g != nullptr && g != gradient) others[i] = g->clone();
  }
  Tensor wrong = right.clone();
  if (plant_.kind == Plant::Kind::term) {
    std::copy_n(gy.data(), gy.size(), b.mutable_gy().data());
    b.mutable_gy().data()[gy.size() / 2] = 0;
    wrong = added_by(step, *gradient);
  } else {
    spoil(plant_.kind, wrong);
  }
  for (std::size_t i = 0; i < inputs; ++i) {
    if (others[i].defined()) std::copy_n(others[i].data(), others[i].size(), b.grad_of(i)->data());
  }
  for (Dim i = 0; i < wrong.size(); ++i) {
    gradient->data()[i] += wrong.data()[i];
    changed_ = changed_ || wrong.data()[i] != right.data()[i];
  }
}

}  // namespace supertac
