// The register-tiled loops, written once over a vector type. Each of portable.cpp, avx2.cpp and
// avx512.cpp defines `Vec` (a value type with kLanes, load, load_part, store, store_part, broadcast, add,
// sub, fma, rectify), kTilePixels, kNarrowTilePixels (for outputs of one vector) and kOuterRows in an
// anonymous namespace, then includes this file.
//
// Nothing here may call an inline function that is not inlined for sure (these files are always built
// with -O3): the linker keeps one copy of it, which might then run on a processor without these instructions.

#define ALWAYS_INLINE inline __attribute__((always_inline))
// A function object that must not become a call.
#define INLINED __attribute__((always_inline))

// Calls run.operator()<P>(first) for tiles of P of `count`: of the first of these sizes as long as they fit,
// then of the next.
template <int... kSizes, class Run>
ALWAYS_INLINE void in_tiles(Dim count, Run run) {
  Dim first = 0;
  const auto of_size = [&]<int P>() INLINED {
    for (; first + P <= count; first += P) run.template operator()<P>(first);
  };
  (of_size.template operator()<kSizes>(), ...);
}

// Calls run.operator()<J, kPartial>(channel) for J vectors of output channels from `channel` on: kMost, 2 and
// 1 at once as long as they fit, then what is left of one.
template <int kMost, class Run>
ALWAYS_INLINE void in_vectors(Dim cout, Run run) {
  Dim channel = 0;
  const auto of_size = [&]<int J>() INLINED {
    if constexpr (J <= kMost)
      for (; channel + J * Vec::kLanes <= cout; channel += J * Vec::kLanes)
        run.template operator()<J, false>(channel);
  };
  of_size.template operator()<4>(), of_size.template operator()<2>(), of_size.template operator()<1>();
  if (channel < cout) run.template operator()<1, true>(channel);
}

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

// What the pixels of a job gather (Phase), and where their inputs lie; `zeros` stand for the padding.
struct Gathered {
  const std::int32_t* taps;
  Dim tap_count;
  const std::int32_t *outputs, *sources;
  const real *zeros, *x;
  Dim x_step;  // from pixel to pixel of x
  real* y;
};

template <int P, int J, bool kPartial>
inline void gather_tile(const GatherJob& job, const Gathered& g, Dim first, Dim channel) {
  constexpr unsigned kAll = (1U << P) - 1;
  const Outputs<J, kPartial> channels(job.cout, channel);
  const std::int32_t *outputs = g.outputs + first, *sources = g.sources + first * g.tap_count;
  Tile<P, J> tile;
  for (int p = 0; p < P; ++p) {
    const real* from = job.into == Into::add ? g.y + outputs[p] * job.cout + channel
                       : job.bias            ? job.bias + channel
                                             : nullptr;
    for (int j = 0; j < J; ++j) tile.sum[p][j] = from == nullptr ? Vec::broadcast(0) : channels.load(from, j);
  }
  for (Dim t = 0; t < g.tap_count; ++t) {
    unsigned pixels = 0;
    for (int p = 0; p < P; ++p) {
      const std::int32_t source = sources[p * g.tap_count + t];
      pixels |= (source >= 0 ? 1U : 0U) << p;
      tile.pixel[p] = source >= 0 ? g.x + source * g.x_step : g.zeros;
    }
    const real* w = job.w + g.taps[t] * job.cin * job.cout + channel;
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
    real* to = g.y + outputs[p] * job.cout + channel;
    for (int j = 0; j < J; ++j)
      channels.store(rectified(Vec::add(tile.sum[p][j], Vec::broadcast(0)), job.negative_slope), to, j);
  }
}

inline void gather_pixels(const GatherJob& job, const Gathered& g, Dim pixels) {
  const auto tile = [&]<int P>(Dim first) INLINED {
    // A single pixel needs more vectors to hide the latency of FMA.
    constexpr int kMost = P == 1 ? 4 : P <= kTilePixels ? 2 : 1;
    in_vectors<kMost>(job.cout, [&]<int J, bool kPartial>(Dim channel)
                                    INLINED { gather_tile<P, J, kPartial>(job, g, first, channel); });
  };
  // Where there is one vector of channels: more pixels instead.
  job.cout <= Vec::kLanes ? in_tiles<kNarrowTilePixels, kTilePixels, 4, 1>(pixels, tile)
                          : in_tiles<kTilePixels, 4, 1>(pixels, tile);
}

alignas(64) const real kZeros[kMaxChannels] = {};

void gather(const GatherJob& job, const real* x, real* y) {
  const Phase* phase = job.phases->data();
  for (std::size_t i = 0; i < job.phases->size(); ++i, ++phase)
    gather_pixels(job,
                  {phase->taps.data(), static_cast<Dim>(phase->taps.size()), phase->outputs.data(),
                   phase->sources.data(), kZeros, x, job.cin, y},
                  static_cast<Dim>(phase->outputs.size()));
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
  for (Dim row = 0; row < rows; row += kRows) {
    const Dim count = rows - row < kRows ? rows - row : kRows;
    Dim first = 0;
    do {
      const bool last = first + inputs >= job.cin;
      piece.w = job.w + first * job.cout;
      piece.cin = last ? job.cin - first : inputs;
      piece.into = first > 0 ? Into::add : job.into;
      piece.negative_slope = last ? job.negative_slope : 1;
      gather_pixels(piece,
                    {kFirstTap, 1, kRowNumbers, kRowNumbers, nullptr, x + row * job.cin + first, job.cin,
                     y + row * job.cout},
                    count);
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
  const auto add_pair = [&](const real* v, const real* g) INLINED {
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

void outer(const OuterJob& job) {
  const auto tile = [&]<int R>(Dim row) INLINED {
    in_vectors<R <= kOuterRows ? 2 : 1>(job.cout, [&]<int J, bool kPartial>(Dim channel) INLINED {
      outer_tile<R, J, kPartial>(job, row, channel);
    });
  };
  // Where there is one vector of channels: more rows instead.
  job.cout <= Vec::kLanes ? in_tiles<2 * kOuterRows, kOuterRows, 4, 1>(job.cin, tile)
                          : in_tiles<kOuterRows, 4, 1>(job.cin, tile);
}
