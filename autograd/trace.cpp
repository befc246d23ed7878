#include "autograd/trace.h"

#include <stdexcept>

namespace supertac {

static thread_local Trace* current = nullptr;

Trace::Trace() {
  if (current != nullptr) throw std::logic_error("Trace: this thread is traced already");
  current = this;
  last_ = std::chrono::steady_clock::now();
}

Trace::~Trace() { current = nullptr; }

void Trace::note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                 const OpSettings* settings) {
  if (current == nullptr) return;
  const auto now = std::chrono::steady_clock::now();
  const double us = std::chrono::duration<double, std::micro>(now - current->last_).count();
  TracedOp& traced =
      current->ops_.emplace_back(TracedOp{op, y, {}, settings != nullptr ? *settings : OpSettings{}, us});
  for (const Variable* x : inputs) traced.inputs.push_back(*x);
  current->noted(traced);
  current->last_ = std::chrono::steady_clock::now();
}

}  // namespace supertac
