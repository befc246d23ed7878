// 3x3 convolutions by Winograd's minimal filtering F(4x4, 3x3) (Lavin & Gray, CVPR 2016): each 4x4 square Y
// of the output comes from the 6x6 patch d of the input around it with 36 instead of 144 products,
//   Y = A^T [sum over cin of (G g G^T) * (B^T d B)] A,   * element by element.
// The 36 places of the patches are 36 matrix products [tiles, cin] x [cin, cout], which run on the same
// register tiles as everything else. Both gradients take the same way back. Rounding errors are ten times
// those of plain sums: 1e-5 of the largest value.
#include "autograd/kernels/fast/conv.h"

#include <algorithm>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

constexpr Dim kPlaces = 36, kSide = 4;
constexpr Dim kFewestImages = 4;    // that repay the transform of the weights
constexpr Dim kFewestTiles = 4;     // of a map: 8x8, 4x16
constexpr Dim kTilesPerStrip = 8;   // these stay in the first cache from transform to transform, ...
constexpr Dim kTilesPerPiece = 64;  // ... these in the second while their weights' gradient is summed
constexpr Dim kPadding = 16;        // between places of weights: powers of two apart they share cache lines

// Of a map; 0 unless 3x3 taps keep its size, whose sides are multiples of 4.
Dim tiles_of(const ConvSizes& s) {
  const ConvSettings& c = s.conv;
  const ConvSettings same{
      .height = c.height, .width = c.width, .kernel_h = 3, .kernel_w = 3, .padding_h = 1, .padding_w = 1};
  return c == same && c.height % kSide == 0 && c.width % kSide == 0 ? c.height * c.width / (kSide * kSide)
                                                                    : 0;
}
Dim place_of(const ConvSizes& s) { return s.cin * s.cout + kPadding; }

// The weights of the gradient: taps in reverse order, [3][3][cin][cout] -> [3][3][cout][cin].
Tensor turned(Dim cin, Dim cout, const real* w) {
  constexpr Dim kTaps = 9;
  Tensor out(Shape{kTaps, cout, cin});
  for (Dim t = 0; t < kTaps; ++t, w += cin * cout)
    isa_kernels().transpose(cin, cout, w, cout, out.data() + (kTaps - 1 - t) * cin * cout, cin);
  return out;
}

// The job for tiles first .. first + count of maps of so many channels.
TileJob tiles(const ConvSizes& s, Dim channels, Dim first, Dim count) {
  const ConvSettings& c = s.conv;
  return {.tiles_down = c.height / kSide,
          .tiles_across = c.width / kSide,
          .map = {c.height * c.width * channels, c.width * channels, channels},
          .channels = channels,
          .first = first,
          .count = count,
          .step = place_step(count, channels)};
}

// Convolves x with weights that were transformed into u, [36 places,cin,cout]; adds to y or sets it.
void filter(const ConvSizes& s, const real* x, const Tensor& u, const real* bias, real negative_slope,
            Slot y) {
  const IsaKernels& isa = isa_kernels();
  const Dim all = s.images * tiles_of(s), strip = std::min(kTilesPerStrip, all);
  Tensor v(Shape{kPlaces, place_step(strip, s.cin)}), m(Shape{kPlaces, place_step(strip, s.cout)});
  for (Dim first = 0; first < all; first += strip) {
    const Dim count = std::min(strip, all - first);
    isa.patches(tiles(s, s.cin, first, count), x, v.data());
    isa.places({kPlaces, count, s.cin, s.cout, place_of(s)}, v.data(), u.data(), m.data());
    isa.squares(tiles(s, s.cout, first, count), m.data(), bias, y.into, negative_slope, y.data);
  }
}

}  // namespace

bool is_winograd(const ConvSizes& s) {
  return s.images >= kFewestImages && tiles_of(s) >= kFewestTiles && s.cin % kTransformChannels == 0 &&
         s.cout % kTransformChannels == 0;
}

void winograd_conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real negative_slope,
                   real* y) {
  Tensor u(Shape{kPlaces, place_of(s)});
  isa_kernels().filters({s.cin * s.cout, place_of(s)}, w, u.data());
  filter(s, x, u, bias, negative_slope, {y, Into::overwrite});
}

void winograd_grad_x(const ConvSizes& s, const real* gy, const real* w, Slot gx) {
  Tensor u(Shape{kPlaces, place_of(s)});
  isa_kernels().filters({s.cin * s.cout, place_of(s)}, turned(s.cin, s.cout, w).data(), u.data());
  filter({s.conv, s.images, s.cout, s.cin}, gy, u, nullptr, 1, gx);
}

// du[place] = sum over tiles of (B^T d B)^T (A gy A^T),   gw = or += G^T du G
void winograd_grad_w(const ConvSizes& s, const real* x, const real* gy, Slot gw) {
  const IsaKernels& isa = isa_kernels();
  const Dim all = s.images * tiles_of(s), piece = std::min(kTilesPerPiece, all);
  Tensor v(Shape{kPlaces, place_step(piece, s.cin)}), m(Shape{kPlaces, place_step(piece, s.cout)});
  Tensor du(Shape{kPlaces, place_of(s)});
  for (Dim first = 0; first < all; first += piece) {
    const Dim count = std::min(piece, all - first);
    isa.patches(tiles(s, s.cin, first, count), x, v.data());
    isa.square_grads(tiles(s, s.cout, first, count), gy, m.data());
    for (Dim place = 0; place < kPlaces; ++place) {
      linear_grad_w(count, s.cin, s.cout, v.data() + place * place_step(count, s.cin),
                    m.data() + place * place_step(count, s.cout),
                    {du.data() + place * place_of(s), first == 0 ? Into::overwrite : Into::add});
    }
  }
  isa.filter_grads({s.cin * s.cout, place_of(s), 4, gw.into}, du.data(), gw.data);
}

}  // namespace supertac::kernels
