// Jobs of the kernels that compiled models run (models/inference/compiled/compiled_model.h). Maps have
// margins of zeros, so that no tap needs to know where the border is, and weights lie as the loops read them.
// Sizes and strides count numbers, not bytes. A job owns nothing: what it points at must live until the
// kernel returns, and results overlap no input.
#pragma once

#include "autograd/tensor.h"

namespace supertac::kernels {

/// Numbers from one image, line or pixel of a map to the next.
struct Strides {
  Dim image = 0, line = 0, pixel = 0;
};

/// y[pixel, :] = f(bias + sum over segments, k of x[pixel + segment + k] * w[segment, k, :]) for the pixels
/// of a map, f(s) = s for s > 0, else negative_slope * s. Strides `from` are those of x, `to` those of y.
/// Neighbours in a line lie side by side, so a row of taps is one segment. A linear layer is the map of one
/// pixel.
struct ProductJob {
  Dim images = 1, height = 1, width = 1;  // of y
  Strides from, to;
  const Dim* segments = nullptr;  // [segment_count], offsets
  Dim segment_count = 0, length = 0;
  const real* w = nullptr;     // [segment_count][length][cout]
  const real* bias = nullptr;  // [cout] or null
  Dim cout = 0;
  real negative_slope = 1;
};

/// For each place of Winograd's transform m[place, tile, :] = sum over cin of v[place, tile, cin] * u[place,
/// cin, :], with v [places][tiles][cin], u [places][cin][cout], m [places][tiles][cout]. From one place of v
/// and m to the next it is place_step() numbers.
struct PlacesJob {
  Dim places = 0, tiles = 0, cin = 0, cout = 0;
  Dim place = 0;  // numbers from one place of u to the next
};

/// Of maps a, x, y [images][height][width][channels], each with strides of its own, and gates, means
/// [images][channels]:
///   `gate`   y[n, i, j, c] = a[n, i, j, c] + x[n, i, j, c] * gates[n, c], or a + x where gates is null
///   `mean`   means[n, c] = the mean over i, j of x[n, i, j, c]
struct MapJob {
  Dim images = 0, height = 0, width = 0, channels = 0;
  Strides a, x, y;
};

/// One output of a 3x3 convolution, f(s) = s for s > 0, else negative_slope * s:
///   y[i, j] = f(bias + sum over c, column, row of x[c, i + row, j + column] * w[c, column, row])
/// with x [cin][height + 2][line], i < height, j < width.
struct PlaneOutput {
  const real* w = nullptr;  // [cin][3 columns][3 rows]
  real bias = 0, negative_slope = 1;
  real* y = nullptr;  // [height][width]
};

/// Such outputs of one image x, whose channels are planes with a margin of one pixel. `line` is the width,
/// filled up to whole vectors of kWidestVector numbers, plus two.
struct PlaneJob {
  Dim height = 0, width = 0, cin = 0, line = 0;
  const PlaneOutput* outputs = nullptr;
  Dim output_count = 0;
};
inline constexpr Dim kWidestVector = 16;

}  // namespace supertac::kernels
