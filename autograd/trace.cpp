#include "autograd/trace.h"

#include <stdexcept>

namespace supertac {

static thread_local Trace* current = nullptr;

Trace::Trace() {
  if (current != nullptr) throw std::logic_error("Trace: this thread is traced already");
  current = this;
}

Trace::~Trace() { current = nullptr; }

void Trace::note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                 const OpSettings* settings) {
  if (current == nullptr) return;
  TracedOp& traced =
      current->ops_.emplace_back(TracedOp{op, y, {}, settings != nullptr ? *settings : OpSettings{}});
  for (const Variable* x : inputs) traced.inputs.push_back(*x);
  current->noted(traced);
}

}  // namespace supertac
