// What a test draws by a seed, and how many seeds it takes.
#pragma once

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac {

/// A number that the environment may set for a study; else the usual one.
inline std::uint64_t number_of(const char* variable, std::uint64_t usual) {
  const char* wanted = std::getenv(variable);
  return wanted == nullptr ? usual : std::strtoull(wanted, nullptr, 10);
}

/// Numbers of a stream, one after the other.
struct Draws {
  RandomStream random;
  std::uint64_t next = 0;
  Draws(std::uint64_t seed, std::uint64_t stream) : random(seed, stream) {}
  double operator()() { return random.uniform(next++); }
  double normal() { return random.normal(next++); }
  bool chance(double share) { return (*this)() < share; }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>((*this)() * static_cast<double>(n)); }
  template <class T>
  T of(std::initializer_list<T> all) {
    return *(all.begin() + below(all.size()));
  }
};

}  // namespace supertac
