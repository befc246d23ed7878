// One Trace and one ReverseWatch for each thread.
#include "autograd/trace.h"

#include <stdexcept>

namespace supertac {

static thread_local Trace* trace = nullptr;
static thread_local ReverseWatch* reverse_watch = nullptr;

Trace::Trace() {
  if (trace != nullptr) throw std::logic_error("Trace: this thread is traced already");
  trace = this;
}
Trace::~Trace() { trace = nullptr; }

void Trace::note(const char* op, const Variable& y, std::span<const Variable* const> inputs,
                 const OpSettings* settings) {
  if (trace == nullptr) return;
  TracedOp& traced =
      trace->ops_.emplace_back(TracedOp{op, y, {}, settings != nullptr ? *settings : OpSettings{}});
  for (const Variable* x : inputs) traced.inputs.push_back(*x);
}

ReverseWatch::ReverseWatch() {
  if (reverse_watch != nullptr) throw std::logic_error("ReverseWatch: this thread is watched already");
  reverse_watch = this;
}
ReverseWatch::~ReverseWatch() { reverse_watch = nullptr; }
ReverseWatch* ReverseWatch::of_this_thread() { return reverse_watch; }

}  // namespace supertac
