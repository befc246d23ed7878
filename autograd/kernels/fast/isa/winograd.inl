// Winograd's transforms (winograd.cpp), over the same vector type as kernels.inl and included behind it.

// For the points 0, 1, -1, 2, -2 and infinity, one dimension of each; transform() applies them to rows, then
// columns.
ALWAYS_INLINE Vec times(double factor, Vec v) {
  return Vec::fma(Vec::broadcast(static_cast<real>(factor)), v, Vec::broadcast(0));
}

struct FilterTransform {  // G
  static constexpr int kIn = 3, kOut = 6;
  ALWAYS_INLINE static void run(const Vec (&g)[3], Vec (&to)[6]) {
    const Vec ends = Vec::add(g[0], g[2]), middle = times(1.0 / 12, g[1]);
    const Vec far = Vec::fma(Vec::broadcast(real(1.0 / 24)), g[0], times(1.0 / 6, g[2]));
    to[0] = times(0.25, g[0]);
    to[1] = times(-1.0 / 6, Vec::add(ends, g[1]));
    to[2] = times(-1.0 / 6, Vec::sub(ends, g[1]));
    to[3] = Vec::add(far, middle);
    to[4] = Vec::sub(far, middle);
    to[5] = g[2];
  }
};
struct FilterGradTransform {  // G^T
  static constexpr int kIn = 6, kOut = 3;
  ALWAYS_INLINE static void run(const Vec (&u)[6], Vec (&to)[3]) {
    const Vec far = Vec::add(u[3], u[4]), near = times(1.0 / 6, Vec::add(u[1], u[2]));
    const Vec difference = times(1.0 / 6, Vec::sub(u[1], u[2]));
    const Vec ends = Vec::fma(Vec::broadcast(real(1.0 / 24)), far, times(0.25, u[0]));
    to[0] = Vec::sub(ends, near);
    to[1] = Vec::sub(times(1.0 / 12, Vec::sub(u[3], u[4])), difference);
    to[2] = Vec::add(Vec::sub(times(1.0 / 6, far), near), u[5]);
  }
};
struct PatchTransform {  // B^T
  static constexpr int kIn = 6, kOut = 6;
  ALWAYS_INLINE static void run(const Vec (&d)[6], Vec (&to)[6]) {
    const Vec four = Vec::broadcast(4), minus_four = Vec::broadcast(-4), minus_five = Vec::broadcast(-5);
    const Vec even = Vec::fma(minus_four, d[2], d[4]), odd = Vec::fma(minus_four, d[1], d[3]);
    const Vec outer = Vec::sub(d[4], d[2]), inner = Vec::sub(d[3], d[1]);
    to[0] = Vec::fma(four, d[0], Vec::fma(minus_five, d[2], d[4]));
    to[1] = Vec::add(even, odd);
    to[2] = Vec::sub(even, odd);
    to[3] = Vec::fma(Vec::broadcast(2), inner, outer);
    to[4] = Vec::fma(Vec::broadcast(-2), inner, outer);
    to[5] = Vec::fma(four, d[1], Vec::fma(minus_five, d[3], d[5]));
  }
};
struct SquareTransform {  // A^T
  static constexpr int kIn = 6, kOut = 4;
  ALWAYS_INLINE static void run(const Vec (&m)[6], Vec (&to)[4]) {
    const Vec even = Vec::add(m[1], m[2]), odd = Vec::sub(m[1], m[2]);
    const Vec even2 = Vec::add(m[3], m[4]), odd2 = Vec::sub(m[3], m[4]);
    to[0] = Vec::add(Vec::add(m[0], even), even2);
    to[1] = Vec::fma(Vec::broadcast(2), odd2, odd);
    to[2] = Vec::fma(Vec::broadcast(4), even2, even);
    to[3] = Vec::add(Vec::fma(Vec::broadcast(8), odd2, odd), m[5]);
  }
};
struct SquareGradTransform {  // A
  static constexpr int kIn = 4, kOut = 6;
  ALWAYS_INLINE static void run(const Vec (&g)[4], Vec (&to)[6]) {
    const Vec even = Vec::add(g[0], g[2]), odd = Vec::add(g[1], g[3]);
    const Vec even2 = Vec::fma(Vec::broadcast(4), g[2], g[0]);
    const Vec half_odd2 = Vec::fma(Vec::broadcast(4), g[3], g[1]);
    to[0] = g[0];
    to[1] = Vec::add(even, odd);
    to[2] = Vec::sub(even, odd);
    to[3] = Vec::fma(Vec::broadcast(2), half_odd2, even2);
    to[4] = Vec::fma(Vec::broadcast(-2), half_odd2, even2);
    to[5] = g[3];
  }
};

// F(2x2, 3x3), for the points 0, 1, -1 and infinity.
struct SmallFilterTransform {
  static constexpr int kIn = 3, kOut = 4;
  ALWAYS_INLINE static void run(const Vec (&g)[3], Vec (&to)[4]) {
    const Vec ends = Vec::add(g[0], g[2]);
    to[0] = g[0];
    to[1] = times(0.5, Vec::add(ends, g[1]));
    to[2] = times(0.5, Vec::sub(ends, g[1]));
    to[3] = g[2];
  }
};
struct SmallPatchTransform {
  static constexpr int kIn = 4, kOut = 4;
  ALWAYS_INLINE static void run(const Vec (&d)[4], Vec (&to)[4]) {
    to[0] = Vec::sub(d[0], d[2]);
    to[1] = Vec::add(d[1], d[2]);
    to[2] = Vec::sub(d[2], d[1]);
    to[3] = Vec::sub(d[3], d[1]);
  }
};
struct SmallSquareTransform {
  static constexpr int kIn = 4, kOut = 2;
  ALWAYS_INLINE static void run(const Vec (&m)[4], Vec (&to)[2]) {
    to[0] = Vec::add(Vec::add(m[0], m[1]), m[2]);
    to[1] = Vec::add(Vec::sub(m[1], m[2]), m[3]);
  }
};

// Applies a transform to the rows of what load(i, j) gives, then to the columns: store(i, j, result).
template <class Transform, class Load, class Store>
ALWAYS_INLINE void transform(Load load, Store store) {
  constexpr int kIn = Transform::kIn, kOut = Transform::kOut;
  Vec half[kOut][kIn];
  for (int i = 0; i < kIn; ++i) {
    Vec from[kIn], row[kOut];
    for (int j = 0; j < kIn; ++j) from[j] = load(i, j);
    Transform::run(from, row);
    for (int j = 0; j < kOut; ++j) half[j][i] = row[j];
  }
  for (int j = 0; j < kOut; ++j) {
    Vec column[kOut];
    Transform::run(half[j], column);
    for (int i = 0; i < kOut; ++i) store(i, j, column[i]);
  }
}

struct TileCorner {
  Dim image, row, column;
};
// Calls body(corner, channel, places from there on) for each tile of a job by a vector of channels.
template <int kSquare, class Places, class Body>
ALWAYS_INLINE void for_each_tile(const TileJob& job, Places* places, Body body) {
  const Dim tiles = job.tiles_down * job.tiles_across;
  for (Dim tile = job.first; tile < job.first + job.count; ++tile, places += job.channels) {
    const Dim image = tile / tiles, row = tile % tiles / job.tiles_across, column = tile % job.tiles_across;
    const TileCorner at{image, row * kSquare, column * kSquare};
    for (Dim c = 0; c < job.channels; c += Vec::kLanes) body(at, c, places + c);
  }
}

template <class Transform>
inline void filters_by(const FilterJob& job, const real* g, real* u) {
  for (Dim k = 0; k < job.weights; k += Vec::kLanes)
    transform<Transform>([&](int i, int j) INLINED { return Vec::load(g + (3 * i + j) * job.weights + k); },
                         [&](int i, int j, Vec to)
                             INLINED { to.store(u + (Transform::kOut * i + j) * job.step + k); });
}

void filters(const FilterJob& job, const real* g, real* u) {
  job.square == 4 ? filters_by<FilterTransform>(job, g, u) : filters_by<SmallFilterTransform>(job, g, u);
}

void filter_grads(const FilterJob& job, const real* u, real* g) {
  for (Dim k = 0; k < job.weights; k += Vec::kLanes)
    transform<FilterGradTransform>(
        [&](int i, int j) INLINED { return Vec::load(u + (6 * i + j) * job.step + k); },
        [&](int i, int j, Vec to) INLINED {
          real* weight = g + (3 * i + j) * job.weights + k;
          const Vec before = job.into == Into::add ? Vec::load(weight) : Vec::broadcast(0);
          Vec::add(before, to).store(weight);
        });
}

// Transforms the pixels of each tile and those up to kReach around it, which are 0 beyond the map unless they
// are there (kThere).
template <class Transform, int kReach, bool kThere>
inline void into_places(const TileJob& job, const real* x, real* places) {
  constexpr int kSquare = Transform::kIn - 2 * kReach;
  const Dim height = job.tiles_down * kSquare, width = job.tiles_across * kSquare;
  for_each_tile<kSquare>(job, places, [&](const TileCorner& at, Dim c, real* to_place) INLINED {
    const real* image = x + at.image * job.map.image + c;
    transform<Transform>(
        [&](int i, int j) INLINED {
          const Dim row = at.row - kReach + i, column = at.column - kReach + j;
          const bool there = kThere || (row >= 0 && row < height && column >= 0 && column < width);
          return Vec::load(there ? image + row * job.map.line + column * job.map.pixel : kZeros);
        },
        [&](int i, int j, Vec to) INLINED { to.store(to_place + (Transform::kOut * i + j) * job.step); });
  });
}

// x, gy and y point at the first pixel of the first map.
void patches(const TileJob& job, const real* x, real* places) {
  if (!job.margin) return into_places<PatchTransform, 1, false>(job, x, places);
  job.square == 4 ? into_places<PatchTransform, 1, true>(job, x, places)
                  : into_places<SmallPatchTransform, 1, true>(job, x, places);
}

void square_grads(const TileJob& job, const real* gy, real* places) {
  into_places<SquareGradTransform, 0, true>(job, gy, places);
}

template <class Transform>
inline void squares_by(const TileJob& job, const real* places, const real* bias, Into into,
                       real negative_slope, real* y) {
  for_each_tile<Transform::kOut>(job, places, [&](const TileCorner& at, Dim c, const real* place) INLINED {
    real* corner = y + at.image * job.map.image + at.row * job.map.line + at.column * job.map.pixel + c;
    const Vec start = Vec::load(bias ? bias + c : kZeros);
    transform<Transform>(
        [&](int i, int j) INLINED { return Vec::load(place + (Transform::kIn * i + j) * job.step); },
        [&](int i, int j, Vec to) INLINED {
          real* pixel = corner + i * job.map.line + j * job.map.pixel;
          rectified(Vec::add(into == Into::add ? Vec::load(pixel) : start, to), negative_slope).store(pixel);
        });
  });
}

void squares(const TileJob& job, const real* places, const real* bias, Into into, real negative_slope,
             real* y) {
  job.square == 4 ? squares_by<SquareTransform>(job, places, bias, into, negative_slope, y)
                  : squares_by<SmallSquareTransform>(job, places, bias, into, negative_slope, y);
}

// P tiles by J vectors of outputs. The weights are met once for each strip of tiles: those of the next place
// are called for while these are used.
template <int P, int J>
ALWAYS_INLINE void place_tile(const PlacesJob& job, const real* v, const real* u, real* m) {
  Vec sum[P][J];
  for (int p = 0; p < P; ++p) {
    for (int j = 0; j < J; ++j) sum[p][j] = Vec::broadcast(0);
  }
#pragma GCC unroll 4
  for (Dim k = 0; k < job.cin; ++k, u += job.cout) {
    Vec weight[J];
    for (int j = 0; j < J; ++j) {
      weight[j] = Vec::load(u + j * Vec::kLanes);
      __builtin_prefetch(u + job.place + j * Vec::kLanes);
    }
    for (int p = 0; p < P; ++p) {
      const Vec value = Vec::broadcast(v[p * job.cin + k]);
      for (int j = 0; j < J; ++j) sum[p][j] = Vec::fma(value, weight[j], sum[p][j]);
    }
  }
  for (int p = 0; p < P; ++p) {
    for (int j = 0; j < J; ++j) sum[p][j].store(m + p * job.cout + j * Vec::kLanes);
  }
}

void places(const PlacesJob& job, const real* v, const real* u, real* m) {
  const Dim v_step = place_step(job.tiles, job.cin), m_step = place_step(job.tiles, job.cout);
  for (Dim i = 0; i < job.places; ++i, v += v_step, u += job.place, m += m_step) {
    in_tiles<kTilePixels, 4, 2, 1>(job.tiles, [&]<int P>(Dim tile) INLINED {
      in_vectors<2>(job.cout, [&]<int J, bool>(Dim channel) INLINED {
        place_tile<P, J>(job, v + tile * job.cin, u + channel, m + tile * job.cout + channel);
      });
    });
  }
}
