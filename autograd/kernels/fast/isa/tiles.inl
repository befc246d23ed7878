// Winograd's products of compiled models (inference.h), over the same vector type as kernels.inl and
// included behind winograd.inl.

template <int kSquare>
ALWAYS_INLINE Dim tile_corner(const MapTileJob& job, Dim tile) {
  const Dim tiles = job.tiles_down * job.tiles_across, within = tile % tiles;
  return tile / tiles * job.map.image + within / job.tiles_across * kSquare * job.map.line +
         within % job.tiles_across * kSquare * job.map.pixel;
}

template <class Transform>
inline void patches_by(const MapTileJob& job, const real* x, real* places) {
  constexpr int kSide = Transform::kIn;
  for (Dim tile = job.first; tile < job.first + job.count; ++tile, places += job.channels) {
    const real* corner = x + tile_corner<kSide - 2>(job, tile);
    for (Dim c = 0; c < job.channels; c += Vec::kLanes) {
      Vec from[kSide][kSide], to[kSide][kSide];
      for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j)
          from[i][j] = Vec::load(corner + i * job.map.line + j * job.map.pixel + c);
      }
      both_ways<Transform>(from, to);
      for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j) to[i][j].store(places + (kSide * i + j) * job.step + c);
      }
    }
  }
}

// x points at the margin's first pixel.
void map_patches(const MapTileJob& job, const real* x, real* places) {
  job.square == 4 ? patches_by<PatchTransform>(job, x, places)
                  : patches_by<SmallPatchTransform>(job, x, places);
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

template <int P>
ALWAYS_INLINE void place_tiles(const PlacesJob& job, Dim& tile, const real* v, const real* u, real* m) {
  for (; tile + P <= job.tiles; tile += P) {
    Dim channel = 0;
    for (; channel + 2 * Vec::kLanes <= job.cout; channel += 2 * Vec::kLanes) {
      place_tile<P, 2>(job, v + tile * job.cin, u + channel, m + tile * job.cout + channel);
    }
    for (; channel < job.cout; channel += Vec::kLanes) {
      place_tile<P, 1>(job, v + tile * job.cin, u + channel, m + tile * job.cout + channel);
    }
  }
}

void places(const PlacesJob& job, const real* v, const real* u, real* m) {
  const Dim v_step = place_step(job.tiles, job.cin), m_step = place_step(job.tiles, job.cout);
  for (Dim i = 0; i < job.places; ++i) {
    Dim tile = 0;
    place_tiles<kTilePixels>(job, tile, v, u, m);
    if constexpr (kTilePixels > 4) place_tiles<4>(job, tile, v, u, m);
    place_tiles<2>(job, tile, v, u, m);
    place_tiles<1>(job, tile, v, u, m);
    v += v_step, u += job.place, m += m_step;
  }
}

template <class Transform>
inline void squares_by(const MapTileJob& job, const real* places, const real* bias, real negative_slope,
                       real* y) {
  constexpr int kSide = Transform::kIn, kSquare = Transform::kOut;
  for (Dim tile = job.first; tile < job.first + job.count; ++tile, places += job.channels) {
    real* corner = y + tile_corner<kSquare>(job, tile);
    for (Dim c = 0; c < job.channels; c += Vec::kLanes) {
      Vec from[kSide][kSide], to[kSquare][kSquare];
      for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j) from[i][j] = Vec::load(places + (kSide * i + j) * job.step + c);
      }
      both_ways<Transform>(from, to);
      const Vec start = Vec::load(bias + c);
      for (int i = 0; i < kSquare; ++i) {
        for (int j = 0; j < kSquare; ++j) {
          const Vec value = rectified(Vec::add(start, to[i][j]), negative_slope);
          value.store(corner + i * job.map.line + j * job.map.pixel + c);
        }
      }
    }
  }
}

// y points at the map's first pixel.
void map_squares(const MapTileJob& job, const real* places, const real* bias, real negative_slope, real* y) {
  job.square == 4 ? squares_by<SquareTransform>(job, places, bias, negative_slope, y)
                  : squares_by<SmallSquareTransform>(job, places, bias, negative_slope, y);
}
