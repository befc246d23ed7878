// A loop over all threads whose body may throw, for rooms that are compiled with OpenMP.
#pragma once

#include <cstddef>
#include <exception>

namespace supertac {

/// body(i) for every i below `count`, in any order. When all have ended, throws what the least i has thrown:
/// an exception must not leave a thread.
template <class Body>
void parallel_for(std::size_t count, const Body& body) {
  std::exception_ptr error;
  std::size_t thrown_by = count;
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < count; ++i) {
    try {
      body(i);
    } catch (...) {
#pragma omp critical
      if (i < thrown_by) thrown_by = i, error = std::current_exception();
    }
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace supertac
