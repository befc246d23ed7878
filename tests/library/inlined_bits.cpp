// What a program makes of our headers' arithmetic with the compiler flags of its own: a hash of many results.
// Compiled by the test with -O3 -march=native and what pkg-config says.
#include <supertac/autograd/kernels/exp.h>

#include <cstdint>
#include <cstdio>
#include <cstring>

int main() {
  std::uint64_t hash = 14695981039346656037ULL;
  for (int i = -400'000; i < 400'000; ++i) {
    const float y = supertac::kernels::sigmoid_same_bits(static_cast<float>(i) * 1.7e-5F);
    std::uint32_t bits;
    std::memcpy(&bits, &y, sizeof bits);
    hash = (hash ^ bits) * 1099511628211ULL;
  }
  std::printf("%016llx\n", static_cast<unsigned long long>(hash));
}
