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
  for_each_tile(job, places, [&](Dim tile, Dim c, real* to_place) INLINED {
    const real* corner = x + tile_corner<Transform::kIn - 2>(job, tile) + c;
    transform<Transform>(
        [&](int i, int j) INLINED { return Vec::load(corner + i * job.map.line + j * job.map.pixel); },
        [&](int i, int j, Vec to) INLINED { to.store(to_place + (Transform::kOut * i + j) * job.step); });
  });
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
  for_each_tile(job, places, [&](Dim tile, Dim c, const real* place) INLINED {
    real* corner = y + tile_corner<Transform::kOut>(job, tile) + c;
    const Vec start = Vec::load(bias + c);
    transform<Transform>(
        [&](int i, int j) INLINED { return Vec::load(place + (Transform::kIn * i + j) * job.step); },
        [&](int i, int j, Vec to) INLINED {
          rectified(Vec::add(start, to), negative_slope).store(corner + i * job.map.line + j * job.map.pixel);
        });
  });
}

// y points at the map's first pixel.
void map_squares(const MapTileJob& job, const real* places, const real* bias, real negative_slope, real* y) {
  job.square == 4 ? squares_by<SquareTransform>(job, places, bias, negative_slope, y)
                  : squares_by<SmallSquareTransform>(job, places, bias, negative_slope, y);
}
