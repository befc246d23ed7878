// The register-tiled loops, written once over a vector type. Each of portable.cpp, avx2.cpp and
// avx512.cpp defines `Vec` (a value type with kLanes, load, load_part, store, store_part, broadcast, add,
// sub, fma, rectify), kTilePixels, kNarrowTilePixels (for outputs of one vector) and kOuterRows in an
// anonymous namespace, then includes this file.
//
// Nothing here may call an inline function that is not inlined for sure (these files are always built
// with -O3): the linker keeps one copy of it, which might then run on a processor without these instructions.

#define ALWAYS_INLINE inline __attribute__((always_inline))

// Rectifier(negative_slope)(x)
ALWAYS_INLINE Vec rectified(Vec x, real negative_slope) {
  constexpr real kLeast = std::numeric_limits<real>::lowest(),
                 kInfinite = -std::numeric_limits<real>::infinity();
  if (negative_slope == 1) return x;
  return Vec::rectify(x, Vec::broadcast(negative_slope),
                      Vec::broadcast(negative_slope == 0 ? kLeast : kInfinite));
}

// J vectors of output channels side by side, from `channel` on. Where kPartial the last is one of fewer
// lanes.
template <int J, bool kPartial>
struct Outputs {
  Outputs(Dim cout, Dim channel) : lanes(cout - channel - (J - 1) * Vec::kLanes) {}
  ALWAYS_INLINE Vec load(const real* p, int j) const {
    p += j * Vec::kLanes;
    return kPartial && j == J - 1 ? Vec::load_part(p, lanes) : Vec::load(p);
  }
  ALWAYS_INLINE void store(Vec v, real* p, int j) const {
    p += j * Vec::kLanes;
    const bool part = kPartial && j == J - 1;
    part ? v.store_part(p, lanes) : v.store(p);
  }
  Dim lanes;
};

// Which pixels of a tile meet a tap at the border of a map, for the maps that occur: a tile of 8 covers a row
// of 8 (first or last pixel cut off) or two rows of 4 (first or last column, row, or both).
template <unsigned... kSets>
struct PixelSets;
template <int P>
struct BorderSetsOf {
  using Type = PixelSets<>;
};
template <>
struct BorderSetsOf<8> {
  using Type = PixelSets<0xFE, 0x7F, 0xEE, 0x77, 0xF0, 0x0F, 0xE0, 0x70, 0x0E, 0x07>;
};

// One tile: P pixels by J vectors of output channels stay in registers while taps and input channels
// stream past. Each output is one accumulator; its sum runs over taps, then input channels.
template <int P, int J>
struct Tile {
  Vec sum[P][J];
  const real* pixel[P];
};

// Adds one tap to those pixels of the tile that it does not carry into the padding.
template <unsigned kPixels, int P, int J, bool kPartial>
ALWAYS_INLINE void add_tap(Tile<P, J>& tile, const real* w, Dim cin, Dim cout, Outputs<J, kPartial> outputs) {
#pragma GCC unroll 4
  for (Dim c = 0; c < cin; ++c, w += cout) {
    Vec weight[J];
    for (int j = 0; j < J; ++j) weight[j] = outputs.load(w, j);
    for (int p = 0; p < P; ++p) {
      if ((kPixels >> p & 1U) == 0) continue;
      const Vec value = Vec::broadcast(tile.pixel[p][c]);
      for (int j = 0; j < J; ++j) tile.sum[p][j] = Vec::fma(value, weight[j], tile.sum[p][j]);
    }
  }
}

// Runs the loop that is compiled for just these pixels; false when there is none.
template <unsigned... kSets>
struct PixelSets {
  template <int P, int J, bool kPartial>
  ALWAYS_INLINE static bool add(unsigned pixels, [[maybe_unused]] Tile<P, J>& tile,
                                [[maybe_unused]] const real* w, [[maybe_unused]] Dim cin,
                                [[maybe_unused]] Dim cout, [[maybe_unused]] Outputs<J, kPartial> channels) {
    return ((pixels == kSets && (add_tap<kSets>(tile, w, cin, cout, channels), true)) || ...);
  }
};

template <int P, int J, bool kPartial>
inline void gather_tile(const GatherJob& job, const std::int32_t* taps, Dim tap_count,
                        const std::int32_t* outputs, const std::int32_t* sources, const real* zeros,
                        const real* x, real* y, Dim channel) {
  constexpr unsigned kAll = (1U << P) - 1;
  const Outputs<J, kPartial> channels(job.cout, channel);
  Tile<P, J> tile;
  for (int p = 0; p < P; ++p) {
    const real* from = job.into == Into::add ? y + outputs[p] * job.cout + channel
                       : job.bias            ? job.bias + channel
                                             : nullptr;
    for (int j = 0; j < J; ++j) tile.sum[p][j] = from == nullptr ? Vec::broadcast(0) : channels.load(from, j);
  }
  for (Dim t = 0; t < tap_count; ++t) {
    unsigned pixels = 0;
    for (int p = 0; p < P; ++p) {
      const std::int32_t source = sources[p * tap_count + t];
      pixels |= (source >= 0 ? 1U : 0U) << p;
      tile.pixel[p] = source >= 0 ? x + source * job.x_step : zeros;
    }
    const real* w = job.w + taps[t] * job.cin * job.cout + channel;
    if (pixels == kAll) {
      add_tap<kAll>(tile, w, job.cin, job.cout, channels);
    } else if (pixels != 0 && !BorderSetsOf<P>::Type::template add<P, J, kPartial>(pixels, tile, w, job.cin,
                                                                                   job.cout, channels)) {
      add_tap<kAll>(tile, w, job.cin, job.cout, channels);  // zeros stand for the padding
    }
  }
  // + 0 turns -0 into +0: a sum of -0 changes its sign where 0 * w is added for a tap in the padding, and not
  // where the tap is skipped, which depends on how many pixels share a tile.
  for (int p = 0; p < P; ++p) {
    real* to = y + outputs[p] * job.cout + channel;
    for (int j = 0; j < J; ++j)
      channels.store(rectified(Vec::add(tile.sum[p][j], Vec::broadcast(0)), job.negative_slope), to, j);
  }
}

template <int P>
inline void gather_channels(const GatherJob& job, const std::int32_t* taps, Dim tap_count,
                            const std::int32_t* outputs, const std::int32_t* sources, const real* zeros,
                            const real* x, real* y) {
  Dim channel = 0;
  if constexpr (P == 1) {  // a single pixel needs more vectors to hide the latency of FMA
    for (; channel + 4 * Vec::kLanes <= job.cout; channel += 4 * Vec::kLanes) {
      gather_tile<P, 4, false>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
    }
  }
  if constexpr (P <= kTilePixels) {
    for (; channel + 2 * Vec::kLanes <= job.cout; channel += 2 * Vec::kLanes) {
      gather_tile<P, 2, false>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
    }
  }
  for (; channel + Vec::kLanes <= job.cout; channel += Vec::kLanes) {
    gather_tile<P, 1, false>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
  }
  if (channel < job.cout) {
    gather_tile<P, 1, true>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
  }
}

inline void gather_pixels(const GatherJob& job, const std::int32_t* taps, Dim tap_count,
                          const std::int32_t* outputs, const std::int32_t* sources, Dim pixels,
                          const real* zeros, const real* x, real* y) {
  Dim q = 0;
  if (job.cout <= Vec::kLanes) {  // one vector of channels: more pixels instead
    for (; q + kNarrowTilePixels <= pixels; q += kNarrowTilePixels) {
      gather_channels<kNarrowTilePixels>(job, taps, tap_count, outputs + q, sources + q * tap_count, zeros, x,
                                         y);
    }
  }
  for (; q + kTilePixels <= pixels; q += kTilePixels) {
    gather_channels<kTilePixels>(job, taps, tap_count, outputs + q, sources + q * tap_count, zeros, x, y);
  }
  for (; q + 4 <= pixels; q += 4) {
    gather_channels<4>(job, taps, tap_count, outputs + q, sources + q * tap_count, zeros, x, y);
  }
  for (; q < pixels; ++q) {
    gather_channels<1>(job, taps, tap_count, outputs + q, sources + q * tap_count, zeros, x, y);
  }
}

alignas(64) const real kZeros[kMaxChannels] = {};

void gather(const GatherJob& whole, const real* x, real* y) {
  GatherJob job = whole;
  job.x_step = job.cin;
  const Phase* phase = job.phases->data();
  for (std::size_t i = 0; i < job.phases->size(); ++i, ++phase) {
    gather_pixels(job, phase->taps.data(), static_cast<Dim>(phase->taps.size()), phase->outputs.data(),
                  phase->sources.data(), static_cast<Dim>(phase->outputs.size()), kZeros, x, y);
  }
}

const std::int32_t kFirstTap[1] = {0};
constexpr Dim kRows = 48;                          // a multiple of every tile's pixels
constexpr Dim kFewRows = 16, kNearWeights = 4096;  // half of a first cache
const std::int32_t kRowNumbers[kRows] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 15,
                                         16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31,
                                         32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 47};

// A few rows meet weights that come from a slower cache. Pieces of whole lines lie one behind the other
// there, and processors fetch what lies ahead; the columns that one tile reads lie a line apart.
void gather_rows(const GatherJob& job, const real* x, real* y, Dim rows) {
  const bool whole = rows > kFewRows || job.cin * job.cout <= kNearWeights;
  const Dim inputs = whole ? job.cin : kNearWeights / job.cout < 8 ? 8 : kNearWeights / job.cout;
  GatherJob piece = job;
  piece.x_step = job.cin;
  for (Dim row = 0; row < rows; row += kRows) {
    const Dim count = rows - row < kRows ? rows - row : kRows;
    Dim first = 0;
    do {
      const bool last = first + inputs >= job.cin;
      piece.w = job.w + first * job.cout;
      piece.cin = last ? job.cin - first : inputs;
      piece.into = first > 0 ? Into::add : job.into;
      piece.negative_slope = last ? job.negative_slope : 1;
      gather_pixels(piece, kFirstTap, 1, kRowNumbers, kRowNumbers, count, nullptr, x + row * job.cin + first,
                    y + row * job.cout);
      first += inputs;
    } while (first < job.cin);
  }
}

// R rows of gw (values of cin) by J vectors of cout; the pairs of all images stream past.
template <int R, int J, bool kPartial>
inline void outer_tile(const OuterJob& job, Dim row, Dim channel) {
  const Outputs<J, kPartial> channels(job.cout, channel);
  const std::int32_t* inputs = job.pairs->inputs.data();
  const std::int32_t* outputs = job.pairs->outputs.data();
  const Dim count = static_cast<Dim>(job.pairs->inputs.size());
  Vec acc[R][J];
  for (int r = 0; r < R; ++r) {
    for (int j = 0; j < J; ++j) {
      acc[r][j] = Vec::broadcast(0);  // what is written at the end is on its way meanwhile
      __builtin_prefetch(job.gw + (row + r) * job.cout + channel + j * Vec::kLanes, 1);
    }
  }
  const auto add_pair = [&](const real* v, const real* g) __attribute__((always_inline)) {
    Vec grad[J];
    for (int j = 0; j < J; ++j) grad[j] = channels.load(g, j);
    for (int r = 0; r < R; ++r) {
      const Vec value = Vec::broadcast(v[r]);
      for (int j = 0; j < J; ++j) acc[r][j] = Vec::fma(value, grad[j], acc[r][j]);
    }
  };
  const real* x = job.x + row;
  const real* gy = job.gy + channel;
  const Dim x_step = job.in_pixels * job.cin, gy_step = job.out_pixels * job.cout;
  if (count == 1) {  // rows of a matrix
    x += inputs[0] * job.cin, gy += outputs[0] * job.cout;
    for (Dim image = 0; image < job.images; ++image, x += x_step, gy += gy_step) add_pair(x, gy);
  } else {
    for (Dim image = 0; image < job.images; ++image, x += x_step, gy += gy_step) {
      for (Dim i = 0; i < count; ++i) add_pair(x + inputs[i] * job.cin, gy + outputs[i] * job.cout);
    }
  }
  for (int r = 0; r < R; ++r) {
    real* to = job.gw + (row + r) * job.cout + channel;
    for (int j = 0; j < J; ++j) {
      const Vec before = job.into == Into::add ? channels.load(to, j) : Vec::broadcast(0);
      channels.store(Vec::add(before, acc[r][j]), to, j);
    }
  }
}

template <int R>
inline void outer_channels(const OuterJob& job, Dim row) {
  Dim channel = 0;
  if constexpr (R <= kOuterRows) {
    for (; channel + 2 * Vec::kLanes <= job.cout; channel += 2 * Vec::kLanes) {
      outer_tile<R, 2, false>(job, row, channel);
    }
  }
  for (; channel + Vec::kLanes <= job.cout; channel += Vec::kLanes) {
    outer_tile<R, 1, false>(job, row, channel);
  }
  if (channel < job.cout) outer_tile<R, 1, true>(job, row, channel);
}

void outer(const OuterJob& job) {
  Dim row = 0;
  if (job.cout <= Vec::kLanes) {  // one vector of channels: more rows instead
    for (; row + 2 * kOuterRows <= job.cin; row += 2 * kOuterRows) outer_channels<2 * kOuterRows>(job, row);
  }
  for (; row + kOuterRows <= job.cin; row += kOuterRows) outer_channels<kOuterRows>(job, row);
  if constexpr (kOuterRows > 4) {
    for (; row + 4 <= job.cin; row += 4) outer_channels<4>(job, row);
  }
  for (; row < job.cin; ++row) outer_channels<1>(job, row);
}
