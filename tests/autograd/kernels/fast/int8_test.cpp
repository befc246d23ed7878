#include "autograd/kernels/fast/int8/numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "autograd/kernels/fast/isa/isa.h"

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

// Of a map with a margin of one pixel; lines may be any number of bytes apart.
struct Layout {
  Dim images, height, width, pixel, gap;
};

// Two segments; the largest bytes everywhere, too: what saturates would show.
void expect_bits_of_the_plain_kernel(const Layout& map, Dim length, Dim kept, bool extreme) {
  const std::array<Dim, 2> segments{0, 40};
  const Dim cout = (kept + 15) / 16 * 16, line = (map.width + 2) * map.pixel + map.gap,
            image = (map.height + 2) * line, size_of_x = map.images * image + 40 + length;
  const auto x = extreme ? std::vector<std::uint8_t>(static_cast<std::size_t>(size_of_x), 255)
                         : numbers<std::uint8_t>(size_of_x, 0, 255);
  const Dim weights = 2 * length * cout;
  const auto w = extreme ? std::vector<std::int8_t>(static_cast<std::size_t>(weights), -127)
                         : numbers<std::int8_t>(weights, -127, 127);
  const auto multiplier = numbers<std::int32_t>(cout, 1, 64), shift = numbers<std::int32_t>(cout, 6, 20),
             offset = numbers<std::int32_t>(cout, -1'000'000, 1'000'000);
  ByteProductJob job{.images = map.images,
                     .height = map.height,
                     .width = map.width,
                     .from = {image, line, map.pixel},
                     .to = {map.height * map.width * kept, map.width * kept, kept},
                     .segments = segments.data(),
                     .segment_count = 2,
                     .length = length,
                     .w = w.data(),
                     .cout = cout,
                     .kept = kept,
                     .outcome = {multiplier.data(), offset.data(), shift.data(), 41, 100}};
  const auto size = static_cast<std::size_t>(map.images * map.height * map.width * kept);
  std::vector<std::int16_t> expected(size);
  std::vector<std::uint8_t> expected_bytes(size);
  std::vector<std::int16_t> scratch(static_cast<std::size_t>(map.images * reach_of(job).count));
  job.scratch = scratch.data();
  const std::vector<BytePlaces> places = places_of(job);
  job.places = places.data(), job.place_count = static_cast<Dim>(places.size());
  kPlainByteKernels.product(job, x.data(), expected.data(), nullptr);
  kPlainByteKernels.product(job, x.data(), nullptr, expected_bytes.data());
  const std::string what = std::to_string(map.height) + "x" + std::to_string(map.width) + ", " +
                           std::to_string(length) + " bytes, " + std::to_string(kept) + " outputs";
  for (const ByteKernels& set : kernels_here()) {
    std::vector<std::int16_t> y(size);
    std::vector<std::uint8_t> bytes(size);
    const ByteProducts products;
    set.product(job, x.data(), y.data(), nullptr);
    set.product(job, x.data(), nullptr, bytes.data());
    EXPECT_EQ(y, expected) << what;
    EXPECT_EQ(bytes, expected_bytes) << what;
  }
}

TEST(Bytes, EveryKernelHasTheBitsOfThePlainOne) {
  const Layout maps[] = {
      {2, 3, 5, 8, 0}, {2, 8, 8, 32, 0}, {3, 1, 17, 32, 0}, {1, 4, 4, 16, 0}, {2, 5, 5, 8, 4}};
  for (const Layout& map : maps)
    for (const Dim length : {12, 36, 64, 96, 400})  // those from 36 on fill rows of tiles
      for (const Dim kept : {1, 7, 16, 20, 32, 64})
        for (const bool extreme : {false, true}) expect_bits_of_the_plain_kernel(map, length, kept, extreme);
}

TEST(Bytes, PlacesHoldEachPixelOnce) {
  for (const Dim height : {1, 4, 7})
    for (const Dim width : {4, 5, 16, 33}) {
      const Dim line = 3 * (width + 2);
      const ByteProductJob job{
          .height = height, .width = width, .from = {0, line, 3}, .to = {0, 100 * width, 100}};
      std::vector<int> seen(static_cast<std::size_t>(height * width));
      const std::vector<BytePlaces> all = places_of(job);
      for (const BytePlaces& places : all)
        for (std::int32_t i = 0; i < places.count; ++i) {
          const auto [place, to] = places.pixels[static_cast<std::size_t>(i)];
          const Dim pixel = to / 100;
          EXPECT_EQ(places.x + 3 * place, pixel / width * line + pixel % width * 3);
          ++seen[static_cast<std::size_t>(pixel)];
        }
      const bool enough = (height - 1) * (width + 2) + width >= 16;
      EXPECT_EQ(!all.empty(), enough);
      EXPECT_EQ(std::ranges::count(seen, enough ? 1 : 0), height * width) << height << "x" << width;
    }
}

TEST(Bytes, NumbersAreRoundedAndStayInRange) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> x{0, 0.124F, 0.125F, 0.375F, -5.25F, 1e6F, -1e6F, nan, inf, -inf, 1};
  std::vector<std::int16_t> numbers(x.size());
  to_numbers(static_cast<Dim>(x.size()), x.data(), 4, numbers.data());
  EXPECT_EQ(numbers, (std::vector<std::int16_t>{0, 0, 1, 2, -21, 32767, -32768, -32768, 32767, -32768, 4}));
  std::vector<std::uint8_t> bytes(x.size());
  to_bytes(static_cast<Dim>(x.size()), numbers.data(), 3, 1, 1, 10, bytes.data());  // by 1.5
  EXPECT_EQ(bytes, (std::vector<std::uint8_t>{10, 10, 12, 13, 0, 255, 0, 0, 255, 0, 16}));
}

// Two pixels of three numbers that meet two outputs: 2 * 3 taps with one segment.
TEST(Bytes, NumbersMakeTheSumsThatAreCountedByHand) {
  const std::array<Dim, 1> segment{0};
  const std::array<std::int16_t, 6> x{1000, -2, 3, 30000, 30000, 30000};
  const std::array<std::int8_t, 6> w{1, 2, 3, -4, 5, 127};
  const std::array<std::int32_t, 2> multiplier{1, 64}, offset{1, 32}, shift{1, 6};
  const ByteProductJob job{.images = 1,
                           .height = 1,
                           .width = 2,
                           .from = {6, 6, 3},
                           .to = {4, 4, 2},
                           .segments = segment.data(),
                           .segment_count = 1,
                           .length = 3,
                           .w = w.data(),
                           .cout = 2,
                           .kept = 2,
                           .outcome = {multiplier.data(), offset.data(), shift.data(), 41}};
  std::array<std::int16_t, 4> y{};
  product_of_numbers(job, x.data(), y.data());
  // (1000 - 6 + 15 + 1) / 2;  2000 + 8 + 381;  30000 * 9 and 30000 * 125 are too large
  EXPECT_EQ(y, (std::array<std::int16_t, 4>{505, 2389, 32767, 32767}));
}

// 32 channels of 16x16 pixels from two latents: more outputs than a map has channels.
TEST(Bytes, NumbersMakeAnyNumberOfOutputs) {
  constexpr Dim kOutputs = 2 * kMaxChannels + 5;
  const Dim segment = 0;
  const std::array<std::int16_t, 2> x{100, 1};
  const std::vector<std::int32_t> multiplier(kOutputs, 1), offset(kOutputs, 1), shift(kOutputs, 1);
  std::vector<std::int8_t> w(2 * kOutputs);
  std::vector<std::int16_t> y(kOutputs), expected;
  for (Dim o = 0; o < kOutputs; ++o) {
    const int a = static_cast<int>(o % 251) - 125, b = static_cast<int>(o % 7);
    w[static_cast<std::size_t>(o)] = static_cast<std::int8_t>(a);
    w[static_cast<std::size_t>(kOutputs + o)] = static_cast<std::int8_t>(b);
    expected.push_back(static_cast<std::int16_t>((100 * a + b + 1) >> 1));
  }
  ByteProductJob job;
  job.segments = &segment, job.segment_count = 1, job.length = 2;
  job.w = w.data(), job.cout = job.kept = kOutputs;
  job.outcome.multiplier = multiplier.data(), job.outcome.offset = offset.data();
  job.outcome.shift = shift.data();
  product_of_numbers(job, x.data(), y.data());
  EXPECT_EQ(y, expected);
}

TEST(Bytes, GatedSumsRoundAndSaturate) {
  const std::array<std::int16_t, 4> a{10, -10, 32000, -32000}, x{5, 5, 32000, 32000},
      gates{4096, 2048, 4096, 0};
  std::array<std::int16_t, 4> y{};
  gated_sum(1, 4, a.data(), x.data(), gates.data(), y.data());
  EXPECT_EQ(y, (std::array<std::int16_t, 4>{15, -7, 32767, -32000}));
  gated_sum(1, 4, a.data(), x.data(), nullptr, y.data());
  EXPECT_EQ(y, (std::array<std::int16_t, 4>{15, -5, 32767, 0}));
}

}  // namespace
}  // namespace supertac::kernels
