// What every function of the C interface is wrapped in: exceptions become a result and a text.
#pragma once

#include <algorithm>
#include <cstring>
#include <exception>
#include <initializer_list>
#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "autograd/record.h"

namespace supertac::c {

/// Keeps what supertac_error() says.
void keep(const char* text) noexcept;

/// What `work` returns; -1 or null, and supertac_error() has the message, when it throws or one of the
/// pointers given to `function` is null.
template <class Work>
auto guarded(const char* function, std::initializer_list<const void*> pointers, Work work) noexcept {
  try {
    for (const void* pointer : pointers)
      if (pointer == nullptr) throw std::invalid_argument(std::string(function) + ": a pointer is NULL");
    return work();
  } catch (const std::bad_alloc&) {
    keep("not enough memory");
  } catch (const std::exception& error) {
    keep(error.what());
  } catch (...) {
    keep("unknown error");
  }
  if constexpr (std::is_pointer_v<decltype(work())>)
    return decltype(work())(nullptr);
  else
    return -1;
}

/// Fills as much of `to` as its size says: later versions have more. Throws std::invalid_argument where that
/// is too small to be one.
template <class Description>
int describe(Description* to, Description full) {
  if (to->size < sizeof(std::size_t))
    refuse("describe", "description.size", "sizeof(*description), set before the call",
           std::to_string(to->size));
  full.size = std::min(to->size, sizeof full);
  std::memcpy(to, &full, full.size);
  return 0;
}

inline void expect(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

/// Throws std::invalid_argument that names `what`.
void expect_within(const char* what, double found, double least, double most);

}  // namespace supertac::c
