// The loops of compiled models (inference.h), over the same vector type as kernels.inl and included behind
// it.

// The pixels of a job one after another.
struct Cursor {
  const ProductJob& job;
  const real* x;
  real* y;
  Dim column = 0, line = 0;

  ALWAYS_INLINE void next() {
    x += job.from.pixel, y += job.to.pixel;
    if (++column < job.width) return;
    x += job.from.line - job.width * job.from.pixel, y += job.to.line - job.width * job.to.pixel;
    column = 0;
    if (++line < job.height) return;
    x += job.from.image - job.height * job.from.line, y += job.to.image - job.height * job.to.line;
    line = 0;
  }
};

// P pixels by J vectors of outputs; each output is one accumulator, its sum runs over segments, then k.
template <int P, int J, bool kPartial>
inline void product_tile(const ProductJob& job, const real* const (&x)[P], real* const (&y)[P], Dim channel) {
  const Outputs<J, kPartial> channels(job.cout, channel);
  Tile<P, J> tile;
  for (int j = 0; j < J; ++j) {
    const Vec start = job.bias == nullptr ? Vec::broadcast(0) : channels.load(job.bias + channel, j);
    for (int p = 0; p < P; ++p) tile.sum[p][j] = start;
  }
  const real* w = job.w + channel;
  for (Dim s = 0; s < job.segment_count; ++s, w += job.length * job.cout) {
    for (int p = 0; p < P; ++p) tile.pixel[p] = x[p] + job.segments[s];
    add_tap<(1U << P) - 1>(tile, w, job.length, job.cout, channels);
  }
  for (int p = 0; p < P; ++p) {
    for (int j = 0; j < J; ++j)
      channels.store(rectified(tile.sum[p][j], job.negative_slope), y[p] + channel, j);
  }
}

void product(const ProductJob& job, const real* x, real* y) {
  Cursor cursor{job, x, y};
  const auto tile = [&]<int P>(Dim) INLINED {
    const real* from[P];
    real* to[P];
    for (int p = 0; p < P; ++p, cursor.next()) from[p] = cursor.x, to[p] = cursor.y;
    // Few pixels need more vectors to hide the latency of FMA.
    constexpr int kMost = P <= 2 ? 4 : P <= kTilePixels ? 2 : 1;
    in_vectors<kMost>(job.cout, [&]<int J, bool kPartial>(Dim channel)
                                    INLINED { product_tile<P, J, kPartial>(job, from, to, channel); });
  };
  const Dim pixels = job.images * job.height * job.width;
  // Where there is one vector of outputs: more pixels instead.
  job.cout <= Vec::kLanes ? in_tiles<kNarrowTilePixels, kTilePixels, 4, 2, 1>(pixels, tile)
                          : in_tiles<kTilePixels, 4, 2, 1>(pixels, tile);
}

// Calls work(image, channel, that vector of channels) for all vectors of all images.
template <class Work>
ALWAYS_INLINE void for_each_vector(const MapJob& job, Work work) {
  for (Dim image = 0; image < job.images; ++image)
    in_vectors<1>(job.channels, [&]<int J, bool kPartial>(Dim c)
                                    INLINED { work(image, c, Outputs<J, kPartial>(job.channels, c)); });
}

void gate(const MapJob& job, const real* a, const real* x, const real* gates, real* y) {
  for_each_vector(job, [&](Dim image, Dim c, auto channels) INLINED {
    const Vec factor = gates ? channels.load(gates + image * job.channels + c, 0) : Vec::broadcast(1);
    for (Dim i = 0; i < job.height; ++i) {
      const real* from = a + image * job.a.image + i * job.a.line + c;
      const real* change = x + image * job.x.image + i * job.x.line + c;
      real* to = y + image * job.y.image + i * job.y.line + c;
      for (Dim j = 0; j < job.width; ++j) {
        channels.store(Vec::fma(channels.load(change, 0), factor, channels.load(from, 0)), to, 0);
        from += job.a.pixel, change += job.x.pixel, to += job.y.pixel;
      }
    }
  });
}

void mean(const MapJob& job, const real* x, real* to) {
  const Vec share = Vec::broadcast(1 / static_cast<real>(job.height * job.width));
  for_each_vector(job, [&](Dim image, Dim c, auto channels) INLINED {
    Vec sum = Vec::broadcast(0);
    for (Dim i = 0; i < job.height; ++i) {
      const real* from = x + image * job.x.image + i * job.x.line + c;
      for (Dim j = 0; j < job.width; ++j, from += job.x.pixel) sum = Vec::add(sum, channels.load(from, 0));
    }
    channels.store(Vec::fma(sum, share, Vec::broadcast(0)), to + image * job.channels + c, 0);
  });
}

// to[j * to_step + i] = from[i * from_step + j] for i < rows, j < columns
void transpose(Dim rows, Dim columns, const real* from, Dim from_step, real* to, Dim to_step) {
  for (Dim i = 0; i < rows; i += Vec::kLanes) {
    for (Dim j = 0; j < columns; j += Vec::kLanes) {
      if (i + Vec::kLanes <= rows && j + Vec::kLanes <= columns) {
        Vec::transpose(from + i * from_step + j, from_step, to + j * to_step + i, to_step);
        continue;
      }
      for (Dim c = j; c < j + Vec::kLanes && c < columns; ++c) {
        for (Dim r = i; r < i + Vec::kLanes && r < rows; ++r) to[c * to_step + r] = from[r * from_step + c];
      }
    }
  }
}

// Planes of one image [height][width][channels]: x and to point at the map's first pixel.
void planes(const PlaneJob& job, Dim x_line, const real* x, real* to) {
  for (Dim row = 0; row < job.height; ++row, x += x_line, to += job.line)
    transpose(job.width, job.cin, x, job.cin, to, (job.height + 2) * job.line);
}

// R lines of O outputs by a vector of columns; each pixel's sum runs over channels, then columns, then rows
// of the kernel.
template <int R, int O>
inline void plane_rows(const PlaneJob& job, const PlaneOutput* outputs, const real* x, Dim at, Dim lanes) {
  Vec sum[O][R];
  const real* w[O];
  for (int o = 0; o < O; ++o) {
    w[o] = outputs[o].w;
    for (int r = 0; r < R; ++r) sum[o][r] = Vec::broadcast(outputs[o].bias);
  }
  const Dim plane = (job.height + 2) * job.line;
  for (Dim c = 0; c < job.cin; ++c, x += plane) {
    for (int column = 0; column < 3; ++column) {
      Vec value[R + 2];
      for (int r = 0; r < R + 2; ++r) value[r] = Vec::load(x + r * job.line + column);
      for (int o = 0; o < O; ++o, w[o - 1] += 3) {
        for (int tap = 0; tap < 3; ++tap) {
          const Vec weight = Vec::broadcast(w[o][tap]);
          for (int r = 0; r < R; ++r) sum[o][r] = Vec::fma(weight, value[r + tap], sum[o][r]);
        }
      }
    }
  }
  for (int o = 0; o < O; ++o) {
    real* y = outputs[o].y + at;
    for (int r = 0; r < R; ++r, y += job.width) {
      const Vec value = rectified(sum[o][r], outputs[o].negative_slope);
      lanes < Vec::kLanes ? value.store_part(y, lanes) : value.store(y);
    }
  }
}

template <int O>
inline void plane_outputs(const PlaneJob& job, const PlaneOutput* outputs, const real* x) {
  for (Dim column = 0; column < job.width; column += Vec::kLanes) {
    const Dim lanes = job.width - column < Vec::kLanes ? job.width - column : Vec::kLanes;
    in_tiles<kPlaneRows, 1>(job.height, [&]<int R>(Dim row) INLINED {
      plane_rows<R, O>(job, outputs, x + row * job.line + column, row * job.width + column, lanes);
    });
  }
}

void plane_conv(const PlaneJob& job, const real* x) {
  in_tiles<2, 1>(job.output_count,
                 [&]<int O>(Dim first) INLINED { plane_outputs<O>(job, job.outputs + first, x); });
}
