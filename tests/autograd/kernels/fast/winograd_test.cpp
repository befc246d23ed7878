// What Winograd's way takes, and its bits; kernels/conv_test.cpp compares it with plain sums.
#include "autograd/kernels/fast/winograd.h"

#include "autograd/kernels/fast/isa/isa.h"
#include "tests/autograd/check.h"

namespace supertac::kernels {
namespace {

using test::numbers;

ConvSettings map_of(Dim height, Dim width) {
  return {.height = height, .width = width, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1};
}

TEST(Winograd, APictureIsTheSameInAnyBatch) {
  ConvTask task{&geometry_of(map_of(8, 8)), 7, 32, 16};
  const Tensor x = numbers({7, 64, 32}, 1), w = numbers({9, 32, 16}, 2), bias = numbers({16}, 3);
  Tensor all(Shape{7, 64, 16});
  winograd_conv(task, x.data(), w.data(), bias.data(), 1, all.data());
  for (const Dim images : {1, 2, 5}) {
    Tensor some(Shape{images, 64, 16});
    task.images = images;
    winograd_conv(task, x.data(), w.data(), bias.data(), 1, some.data());
    for (Dim i = 0; i < some.size(); ++i) ASSERT_EQ(some.data()[i], all.data()[i]) << images << ' ' << i;
  }
}

TEST(Winograd, OtherShapesGoTheUsualWay) {
  const auto taken = [](Dim height, Dim width, Dim images, Dim cin, Dim cout) {
    return is_winograd({&geometry_of(map_of(height, width)), images, cin, cout});
  };
  EXPECT_TRUE(taken(8, 8, 4, 16, 16));
  EXPECT_FALSE(taken(8, 8, 3, 16, 16));
  EXPECT_FALSE(taken(4, 4, 64, 32, 32));
  EXPECT_FALSE(taken(10, 8, 64, 32, 32));
  EXPECT_FALSE(taken(8, 8, 64, 24, 32));
  EXPECT_FALSE(taken(8, 8, 64, 32, 8));
  ConvSettings strided = map_of(8, 8);
  strided.stride_h = strided.stride_w = 2;
  EXPECT_FALSE(is_winograd({&geometry_of(strided), 64, 32, 32}));
  ConvSettings up = map_of(8, 8);
  up.transposed = true;
  EXPECT_FALSE(is_winograd({&geometry_of(up), 64, 32, 32}));
}

// The filters of a map's taps, of which those that are not there are 0, transformed beforehand and on the
// way.
void expect_places_of_filters(const IsaKernels& isa, Taps down, Taps across, Dim tiles) {
  constexpr Dim cin = 16, cout = 2 * kFilterChannels, size = cin * cout, places = 36;
  const auto first = [](Taps t) { return t == Taps::last_two ? 1 : 0; };
  const auto count = [](Taps t) { return t == Taps::three ? 3 : 2; };
  const Tensor w = numbers({9, size}, 1), v = numbers({places, place_step(tiles, cin)}, 2);
  std::vector<Dim> taps;
  Tensor square = Tensor::zeros({9, size}), u({places, size});
  for (Dim i = 0; i < count(down); ++i)
    for (Dim j = 0; j < count(across); ++j) {
      taps.push_back((8 - static_cast<Dim>(taps.size())) * size);
      std::copy_n(w.data() + taps.back(), size,
                  square.data() + (3 * (i + first(down)) + j + first(across)) * size);
    }
  Tensor expected = Tensor::zeros({places, place_step(tiles, cout)}), found = expected.clone();
  isa.filters({size, size}, square.data(), u.data());
  isa.places({places, tiles, cin, cout, size}, v.data(), u.data(), expected.data());
  isa.filtered_places({down, across, taps.data(), tiles, cin, cout}, v.data(), w.data(), found.data());
  EXPECT_TRUE(test::same_bytes(expected, found)) << isa.name << ", " << tiles << " tiles";
}

TEST(Winograd, FiltersOnTheWayGiveTheBitsOfThoseBeforehand) {
  for (const IsaKernels* isa : supported_sets()) {
    if (isa == &kPlainKernels) continue;
    for (const Dim tiles : {1, 3, 4, 6}) {
      expect_places_of_filters(*isa, Taps::three, Taps::three, tiles);
      for (const Taps down : {Taps::first_two, Taps::last_two})
        for (const Taps across : {Taps::first_two, Taps::last_two})
          expect_places_of_filters(*isa, down, across, tiles);
    }
  }
}

}  // namespace
}  // namespace supertac::kernels
