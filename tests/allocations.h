// Counts what goes to the heap and lets it fail: operator new and delete of a program that is linked with
// allocations.cpp.
#pragma once

#include <atomic>

namespace supertac::allocations {

inline std::atomic<long> made{0};          ///< blocks handed out so far
inline std::atomic<long> live{0};          ///< of these not given back
inline std::atomic<long> until_fails{-1};  ///< allocations that succeed before one throws; negative: all do
inline std::atomic<bool> failed{false};    ///< set by that one

}  // namespace supertac::allocations
