// Random numbers from a counter: no state, so that the n-th number of a stream is the same whichever thread
// asks for it, and in whichever order.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace supertac {

/// Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011): four random words
/// for every 128-bit counter and 64-bit key.
std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key);

/// The standard normal distribution's inverse, p in (0, 1), relative error about 1e-16: algorithm AS 241,
/// PPND16 (Wichura 1988). Uses +, -, *, / and sqrt only, so that the bits do not depend on the C library.
double inverse_normal(double p);

/// The letters of a short name as one number, the last the lowest byte: which stream it is.
constexpr std::uint64_t stream_named(std::string_view name) {
  std::uint64_t number = 0;
  for (const char letter : name) number = number << 8 | static_cast<unsigned char>(letter);
  return number;
}

/// A stream of random numbers: a pure function of (seed, stream, counter). The three methods draw from the
/// same words; use different counters (or streams) for numbers that have to be independent.
struct RandomStream {
  RandomStream(std::uint64_t seed, std::uint64_t stream) : seed_(seed), stream_(stream) {}

  /// 32 uniform bits.
  std::uint32_t bits(std::uint64_t counter) const;
  /// Uniform in [0, 1), a multiple of 2^-53.
  double uniform(std::uint64_t counter) const;
  /// Normal with mean 0 and variance 1; |value| < 8.3.
  double normal(std::uint64_t counter) const;

 private:
  std::uint64_t word64(std::uint64_t counter) const;

  std::uint64_t seed_;
  std::uint64_t stream_;
};

}  // namespace supertac
