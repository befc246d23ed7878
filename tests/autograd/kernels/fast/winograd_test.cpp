// Winograd's way must give what plain sums give, up to its larger rounding.
#include "autograd/kernels/fast/winograd.h"

#include <cmath>

#include "autograd/kernels/fast/isa/isa.h"
#include "tests/autograd/check.h"

namespace supertac::kernels {
namespace {

using test::numbers;

constexpr double kTolerance = sizeof(real) == 4 ? 2e-5 : 1e-13;

ConvSettings map_of(Dim height, Dim width) {
  return {.height = height, .width = width, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1};
}

struct Layer {
  Dim height, width, images, cin, cout;
};
const Layer kLayers[] = {{8, 8, 4, 16, 16},
                         {8, 8, 7, 32, 48},
                         {16, 16, 5, 32, 16},
                         {12, 8, 6, 16, 32},
                         {12, 12, 57, 16, 16}};  // of 513 tiles the last is alone in its piece

// Calls visit(image, tap, input pixel, output pixel) for all pairs that a tap joins.
template <class Visit>
void for_all_pairs(const ConvTask& s, Visit visit) {
  for (Dim n = 0; n < s.images; ++n)
    for (Dim t = 0; t < s.geometry->taps; ++t) {
      const TapPairs& pairs = s.geometry->pairs[static_cast<std::size_t>(t)];
      for (std::size_t i = 0; i < pairs.inputs.size(); ++i)
        visit(n * s.geometry->in_pixels + pairs.inputs[i], t, n * s.geometry->out_pixels + pairs.outputs[i]);
    }
}

void expect_near(const Tensor& found, const std::vector<double>& expected, const char* what) {
  double largest = 1;
  for (const double e : expected) largest = std::max(largest, std::abs(e));
  for (Dim i = 0; i < found.size(); ++i)
    ASSERT_NEAR(static_cast<double>(found.data()[i]), expected[static_cast<std::size_t>(i)],
                kTolerance * largest)
        << what << ' ' << i;
}

std::vector<double> doubles(const Tensor& t) { return {t.data(), t.data() + t.size()}; }

struct Problem {
  explicit Problem(const Layer& c)
      : sizes{&geometry_of(map_of(c.height, c.width)), c.images, c.cin, c.cout},
        x(numbers({c.images, c.height * c.width, c.cin}, 1)),
        w(numbers({9, c.cin, c.cout}, 2)),
        bias(numbers({c.cout}, 3)),
        gy(numbers({c.images, c.height * c.width, c.cout}, 4)) {}

  ConvTask sizes;
  Tensor x, w, bias, gy;
};

TEST(Winograd, ConvolutionIsThatOfPlainSums) {
  for (const Layer& c : kLayers)
    for (const real slope : {real(1), real(0.25)}) {
      const Problem p(c);
      std::vector<double> expected(static_cast<std::size_t>(p.gy.size()));
      for (std::size_t i = 0; i < expected.size(); ++i)
        expected[i] = static_cast<double>(p.bias.data()[i % static_cast<std::size_t>(c.cout)]);
      for_all_pairs(p.sizes, [&](Dim in, Dim tap, Dim out) {
        for (Dim i = 0; i < c.cin; ++i)
          for (Dim o = 0; o < c.cout; ++o)
            expected[static_cast<std::size_t>(out * c.cout + o)] +=
                static_cast<double>(p.x.data()[in * c.cin + i]) *
                static_cast<double>(p.w.data()[(tap * c.cin + i) * c.cout + o]);
      });
      for (double& e : expected) e = e > 0 ? e : static_cast<double>(slope) * e;
      ASSERT_TRUE(is_winograd(p.sizes));
      Tensor y(p.gy.shape());
      winograd_conv(p.sizes, p.x.data(), p.w.data(), p.bias.data(), slope, y.data());
      expect_near(y, expected, "y");
    }
}

TEST(Winograd, BothGradientsAreThoseOfPlainSums) {
  for (const Layer& c : kLayers) {
    const Problem p(c);
    const Tensor start_x = numbers(p.x.shape(), 5), start_w = numbers(p.w.shape(), 6);
    std::vector<double> gx = doubles(start_x), gw = doubles(start_w);
    for_all_pairs(p.sizes, [&](Dim in, Dim tap, Dim out) {
      for (Dim i = 0; i < c.cin; ++i)
        for (Dim o = 0; o < c.cout; ++o) {
          const double g = static_cast<double>(p.gy.data()[out * c.cout + o]);
          const Dim weight = (tap * c.cin + i) * c.cout + o;
          gx[static_cast<std::size_t>(in * c.cin + i)] += g * static_cast<double>(p.w.data()[weight]);
          gw[static_cast<std::size_t>(weight)] += g * static_cast<double>(p.x.data()[in * c.cin + i]);
        }
    });
    Tensor added = start_x.clone(), written = start_x.clone(), weights = start_w.clone();
    winograd_grad_x(p.sizes, p.gy.data(), p.w.data(), Into::add, added.data());
    winograd_grad_w(p.sizes, p.x.data(), p.gy.data(), Into::add, weights.data());
    expect_near(added, gx, "gx added");
    expect_near(weights, gw, "gw");
    winograd_grad_x(p.sizes, p.gy.data(), p.w.data(), Into::overwrite, written.data());
    for (std::size_t i = 0; i < gx.size(); ++i) gx[i] -= static_cast<double>(start_x.data()[i]);
    expect_near(written, gx, "gx");
  }
}

TEST(Winograd, APictureIsTheSameInAnyBatch) {
  const Problem p({8, 8, 7, 32, 16});
  Tensor all(p.gy.shape());
  winograd_conv(p.sizes, p.x.data(), p.w.data(), p.bias.data(), 1, all.data());
  for (const Dim images : {1, 2, 5}) {
    Tensor some(Shape{images, 64, 16});
    ConvTask sizes = p.sizes;
    sizes.images = images;
    winograd_conv(sizes, p.x.data(), p.w.data(), p.bias.data(), 1, some.data());
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
