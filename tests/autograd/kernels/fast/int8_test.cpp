#include "autograd/kernels/fast/int8.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <vector>

#include "autograd/kernels/fast/isa.h"

namespace supertac::kernels {
namespace {

template <class T>
std::vector<T> numbers(Dim count, int low, int high) {
  std::vector<T> values(static_cast<std::size_t>(count));
  std::uint32_t state = 1;
  for (T& v : values) {
    state = state * 1664525U + 1013904223U;
    v = static_cast<T>(low + static_cast<int>((state >> 8) % static_cast<std::uint32_t>(high - low + 1)));
  }
  return values;
}

std::vector<ByteKernels> kernels_here() {
  std::vector<ByteKernels> all;
  const IsaKernels& before = isa_kernels();
  for (const IsaKernels* set : supported_sets()) {
    use_isa(*set);
    all.push_back(byte_kernels());
  }
  use_isa(before);
#if defined(__x86_64__) && !defined(SUPERTAC_REAL_IS_DOUBLE)
  if (__builtin_cpu_supports("avx512vnni")) all.push_back(kVnniByteKernels);  // where there are tiles too
#endif
  return all;
}

// Maps of 2 x 3 x 5 pixels and two segments; the largest bytes everywhere, too: what saturates would show.
void expect_bits_of_the_plain_kernel(Dim length, Dim kept, bool extreme) {
  const std::array<Dim, 2> segments{0, 40};
  const Dim cout = (kept + 15) / 16 * 16, images = 2, height = 3, width = 5, size_of_x = 1000;
  const auto x =
      extreme ? std::vector<std::uint8_t>(size_of_x, 255) : numbers<std::uint8_t>(size_of_x, 0, 255);
  const Dim weights = 2 * length * cout;
  const auto w = extreme ? std::vector<std::int8_t>(static_cast<std::size_t>(weights), -127)
                         : numbers<std::int8_t>(weights, -127, 127);
  const auto scale = numbers<float>(cout, 1, 9), bias = numbers<float>(cout, -9, 9);
  ByteProductJob job{.images = images,
                     .height = height,
                     .width = width,
                     .from = {300, 60, 8},
                     .to = {height * width * kept, width * kept, kept},
                     .segments = segments.data(),
                     .segment_count = 2,
                     .length = length,
                     .w = w.data(),
                     .cout = cout,
                     .kept = kept,
                     .outcome = {scale.data(), bias.data(), 0.01F, {700.0F, 100}}};
  const auto size = static_cast<std::size_t>(images * height * width * kept);
  std::vector<float> expected(size), y(size);
  std::vector<std::uint8_t> expected_bytes(size), bytes(size);
  std::vector<std::int16_t> scratch(static_cast<std::size_t>(images * reach_of(job).count));
  job.scratch = scratch.data();
  const std::vector<BytePlaces> places = places_of(job);
  job.places = places.data(), job.place_count = static_cast<Dim>(places.size());
  kPlainByteKernels.product(job, x.data(), expected.data(), expected_bytes.data());
  for (const ByteKernels& set : kernels_here()) {
    set.product(job, x.data(), y.data(), bytes.data());
    EXPECT_EQ(y, expected) << length << " bytes, " << kept << " outputs";
    EXPECT_EQ(bytes, expected_bytes) << length << " bytes, " << kept << " outputs";
  }
}

TEST(Bytes, EveryKernelHasTheBitsOfThePlainOne) {
  for (const Dim length : {12, 36, 64, 96, 400})  // those from 36 on fill rows of tiles
    for (const Dim kept : {1, 7, 16, 20, 32, 64})
      for (const bool extreme : {false, true}) expect_bits_of_the_plain_kernel(length, kept, extreme);
}

TEST(Bytes, RoundToTheNearestAndStayInRange) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> x{0, 0.24F, 0.25F, 0.75F, -5.25F, 400, -400, nan, inf, -inf, 1};
  const std::vector<std::uint8_t> expected{10, 10, 10, 12, 0, 255, 0, 0, 255, 0, 12};
  for (const ByteKernels& set : kernels_here()) {
    std::vector<std::uint8_t> bytes(x.size());
    set.line_to_bytes(static_cast<Dim>(x.size()), x.data(), {0.5F, 10}, bytes.data());
    EXPECT_EQ(bytes, expected);
  }
}

}  // namespace
}  // namespace supertac::kernels
