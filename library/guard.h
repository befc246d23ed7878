// What every function of the C interface is wrapped in: exceptions become a result and a text.
#pragma once

#include <exception>
#include <new>
#include <stdexcept>
#include <string>

namespace supertac::c {

/// Keeps what supertac_error() says.
void keep(const char* text) noexcept;

/// What `work` returns, or `failed` when it throws; supertac_error() then has the message.
template <class Result, class Work>
Result guarded(Result failed, Work work) noexcept {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    keep("not enough memory");
  } catch (const std::exception& error) {
    keep(error.what());
  } catch (...) {
    keep("unknown error");
  }
  return failed;
}

inline void expect(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

/// Throws std::invalid_argument that names `what`.
void expect_within(const char* what, double found, double least, double most);

}  // namespace supertac::c
