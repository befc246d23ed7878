#include "autograd/kernels/fast/int8/int8.h"

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
  const auto scale = numbers<float>(cout, 1, 9), bias = numbers<float>(cout, -9, 9);
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
                     .outcome = {scale.data(), bias.data(), 0.01F, {700.0F, 100}}};
  const auto size = static_cast<std::size_t>(map.images * map.height * map.width * kept);
  std::vector<float> expected(size);
  std::vector<std::uint8_t> expected_bytes(size);
  std::vector<std::int16_t> scratch(static_cast<std::size_t>(map.images * reach_of(job).count));
  job.scratch = scratch.data();
  const std::vector<BytePlaces> places = places_of(job);
  job.places = places.data(), job.place_count = static_cast<Dim>(places.size());
  kPlainByteKernels.product(job, x.data(), expected.data(), expected_bytes.data());
  const std::string what = std::to_string(map.height) + "x" + std::to_string(map.width) + ", " +
                           std::to_string(length) + " bytes, " + std::to_string(kept) + " outputs";
  for (const ByteKernels& set : kernels_here()) {
    std::vector<float> y(size), y_alone(size);
    std::vector<std::uint8_t> bytes(size), bytes_alone(size);
    const ByteProducts products;
    set.product(job, x.data(), y.data(), bytes.data());
    set.product(job, x.data(), y_alone.data(), nullptr);
    set.product(job, x.data(), nullptr, bytes_alone.data());
    EXPECT_EQ(y, expected) << what;
    EXPECT_EQ(y_alone, expected) << what;
    EXPECT_EQ(bytes, expected_bytes) << what;
    EXPECT_EQ(bytes_alone, expected_bytes) << what;
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
