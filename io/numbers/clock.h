// The clocks of the system.
#pragma once

#include <time.h>

namespace supertac {

/// Seconds of a clock of the system: CLOCK_MONOTONIC, CLOCK_THREAD_CPUTIME_ID. May be called in a signal
/// handler.
inline double seconds_of(clockid_t clock) {
  timespec t{};
  ::clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace supertac
