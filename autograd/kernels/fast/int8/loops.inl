// The register-tiled loop over bytes. Each of avx2.cpp and vnni.cpp defines in an anonymous
// namespace `Sums` (kLanes integers: zero, dot, finish, below; of Values, bytes or wider), kTile and kVectors
// of P pixels, then includes this file.

#define ALWAYS_INLINE inline __attribute__((always_inline))

template <int P, int J>
ALWAYS_INLINE void byte_tile(const ByteProductJob& job, const Sums::Value* const (&x)[P], const Dim (&at)[P],
                             Dim channel, std::int16_t* y, std::uint8_t* bytes) {
  Sums sum[P][J];
  for (int p = 0; p < P; ++p) {
    for (int j = 0; j < J; ++j) sum[p][j] = Sums::zero();
  }
  const std::int8_t* w = job.w + channel * kQuad;
  for (Dim s = 0; s < job.segment_count; ++s) {
    const Sums::Value* pixel[P];
    for (int p = 0; p < P; ++p) pixel[p] = x[p] + job.segments[s];
#pragma GCC unroll 2
    for (Dim k = 0; k < job.length; k += kQuad, w += job.cout * kQuad) {
      Sums::Weights weight[J];
      for (int j = 0; j < J; ++j) weight[j] = Sums::weights(w + j * Sums::kLanes * kQuad);
      for (int p = 0; p < P; ++p) {
        const Sums::Values value = Sums::values(pixel[p] + k);
        for (int j = 0; j < J; ++j) sum[p][j].dot(value, weight[j]);
      }
    }
  }
#pragma GCC unroll 4
  for (int j = 0; j < J; ++j) {
    const Dim c = channel + j * Sums::kLanes;
    if (c >= job.kept) break;
    const Sums::Finish finish(job.outcome, c, job.kept - c);
#pragma GCC unroll 8  // indexed at run time, the sums would lie in memory
    for (int p = 0; p < P; ++p)
      finish(sum[p][j], y ? y + at[p] + c : nullptr, bytes ? bytes + at[p] + c : nullptr);
  }
}

// The pixels of a job one after another.
struct ByteCursor {
  const ByteProductJob& job;
  const Sums::Value* x;
  Dim at = 0, column = 0, line = 0;

  ALWAYS_INLINE void next() {
    x += job.from.pixel, at += job.to.pixel;
    if (++column < job.width) return;
    x += job.from.line - job.width * job.from.pixel, at += job.to.line - job.width * job.to.pixel;
    column = 0;
    if (++line < job.height) return;
    x += job.from.image - job.height * job.from.line, at += job.to.image - job.height * job.to.line;
    line = 0;
  }
};

template <int P>
inline void byte_pixels(const ByteProductJob& job, ByteCursor& cursor, std::int16_t* y, std::uint8_t* bytes) {
  const Sums::Value* x[P];
  Dim at[P];
  for (int p = 0; p < P; ++p, cursor.next()) x[p] = cursor.x, at[p] = cursor.at;
  Dim channel = 0;
  if constexpr (2 < kVectors<P>) {
    for (; channel + 3 * Sums::kLanes < job.kept; channel += 4 * Sums::kLanes)
      byte_tile<P, 4>(job, x, at, channel, y, bytes);
  }
  if constexpr (1 < kVectors<P>) {
    for (; channel + Sums::kLanes < job.kept; channel += 2 * Sums::kLanes)
      byte_tile<P, 2>(job, x, at, channel, y, bytes);
  }
  for (; channel < job.kept; channel += Sums::kLanes) byte_tile<P, 1>(job, x, at, channel, y, bytes);
}

inline void run(const ByteProductJob& job, const Sums::Value* x, std::int16_t* y, std::uint8_t* bytes) {
  ByteCursor cursor{job, x};
  Dim left = job.images * job.height * job.width;
  for (; left >= kTile; left -= kTile) byte_pixels<kTile>(job, cursor, y, bytes);
  for (; left >= 2; left -= 2) byte_pixels<2>(job, cursor, y, bytes);
  if (left > 0) byte_pixels<1>(job, cursor, y, bytes);
}
