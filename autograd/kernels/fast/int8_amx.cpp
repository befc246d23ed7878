#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <algorithm>
#include <array>
#include <span>

#include "autograd/kernels/fast/int8_finish512.h"

// Tiles of the processor: a pixel's bytes are a row of A, four bytes of sixteen outputs a row of B, and one
// instruction adds A B to a tile of 16 x 16 sums.
namespace supertac::kernels {
namespace {

constexpr Dim kPixels = 16, kOutputs = 16, kRowBytes = 64;

// Tiles 0 to 3 are sums, [pixels][outputs]; 4 and 5 hold pixels, 6 and 7 weights.
struct alignas(64) TileShapes {
  explicit TileShapes(Dim chunk) {
    for (const std::size_t sums : {0, 1, 2, 3}) row_bytes[sums] = kRowBytes, rows[sums] = kPixels;
    for (const std::size_t x : {4, 5}) row_bytes[x] = static_cast<std::uint16_t>(chunk), rows[x] = kPixels;
    for (const std::size_t w : {6, 7})
      row_bytes[w] = kRowBytes, rows[w] = static_cast<std::uint8_t>(chunk / kQuad);
  }
  std::uint8_t palette = 1, start_row = 0, reserved[14] = {};
  std::array<std::uint16_t, 16> row_bytes{};
  std::array<std::uint8_t, 16> rows{};
};

struct Whole {
  Whole() = default;
  Whole(const Outcome& o, Dim channel)
      : scale(_mm512_loadu_ps(o.scale + channel)),
        bias(_mm512_loadu_ps(o.bias + channel)),
        slope(_mm512_set1_ps(o.negative_slope)),
        per_step(_mm512_set1_ps(o.steps.per_step)),
        first(_mm512_set1_ps(static_cast<float>(o.steps.zero))) {}
  __attribute__((always_inline)) void operator()(__m512i sum, float* y, std::uint8_t* bytes) const {
    const __m512 v = _mm512_fmadd_ps(_mm512_cvtepi32_ps(sum), scale, bias),
                 value = _mm512_max_ps(v, _mm512_mul_ps(v, slope));
    if (y != nullptr) _mm512_storeu_ps(y, value);
    if (bytes == nullptr) return;
    const __m512 level = _mm512_max_ps(_mm512_fmadd_ps(value, per_step, first), _mm512_setzero_ps());
    _mm_storeu_si128(reinterpret_cast<__m128i*>(bytes), _mm512_cvtusepi32_epi8(_mm512_cvtps_epi32(level)));
  }
  __m512 scale, bias, slope, per_step, first;
};

// Sixteen places of one of the images.
struct Tile {
  const std::uint8_t* x;
  const BytePlaces* places;
  Dim to;
};

// A job of some outputs, J times sixteen from `channel` on, to numbers or bytes or both. The sums of two
// tiles of places are finished while the next two are summed.
template <int J, bool kNumbers, bool kBytes>
class Outputs {
 public:
  Outputs(const ByteProductJob& job, std::span<const Dim> at, Dim chunk, Dim channel, float* y,
          std::uint8_t* bytes)
      : job_(job),
        at_(at),
        w_(job.w + channel * kQuad),
        w_row_(job.cout * kQuad),
        w_tile_(chunk * job.cout),
        y_(y + (kNumbers ? channel : 0)),
        bytes_(bytes + (kBytes ? channel : 0)),
        some_((2 * kPixels + static_cast<Dim>(at.size()) - 1) / static_cast<Dim>(at.size())) {
    for (int j = 0; j < J; ++j) finish_[j] = Whole(job.outcome, channel + j * kOutputs);
  }
  void run(const std::uint8_t* x) {
    const Dim tiles = job_.images * job_.place_count;
    Dim t = 0;
    for (; t + 2 <= tiles; t += 2) sum<2>({tile(x, t), tile(x, t + 1)});
    if (t < tiles) sum<1>({tile(x, t)});
    finish(2 * kPixels, finish_);
  }

 private:
  Tile tile(const std::uint8_t* x, Dim t) const {
    const Dim n = t / job_.place_count;
    const BytePlaces* places = job_.places + t % job_.place_count;
    return {x + n * job_.from.image + places->x, places, n * job_.to.image};
  }
  template <int P>
  void sum(const Tile (&tiles)[P]) {
    _tile_zero(0);
    if constexpr (J == 2) _tile_zero(1);
    if constexpr (P == 2) _tile_zero(2);
    if constexpr (P == 2 && J == 2) _tile_zero(3);
    const std::array<Whole, J> with = finish_;
    const std::int8_t* w = w_;
    const Dim row = job_.from.pixel;
    for (const Dim offset : at_) {
      _tile_loadd(6, w, w_row_);
      _tile_loadd(4, tiles[0].x + offset, row);
      _tile_dpbusd(0, 4, 6);
      if constexpr (J == 2) _tile_loadd(7, w + kOutputs * kQuad, w_row_);
      if constexpr (J == 2) _tile_dpbusd(1, 4, 7);
      if constexpr (P == 2) {
        _tile_loadd(5, tiles[1].x + offset, row);
        _tile_dpbusd(2, 5, 6);
        if constexpr (J == 2) _tile_dpbusd(3, 5, 7);
      }
      finish(some_, with);
      w += w_tile_;
    }
    finish(2 * kPixels, with);
    _tile_stored(0, sums_[0], kRowBytes);
    if constexpr (J == 2) _tile_stored(1, sums_[1], kRowBytes);
    if constexpr (P == 2) _tile_stored(2, sums_[2], kRowBytes);
    if constexpr (P == 2 && J == 2) _tile_stored(3, sums_[3], kRowBytes);
    count_ = 0;
    for (int p = 0; p < P; ++p) {
      for (std::int32_t i = 0; i < tiles[p].places->count; ++i) {
        const BytePlaces::Pixel& pixel = tiles[p].places->pixels[static_cast<std::size_t>(i)];
        left_[count_++] = {2 * p * kPixels * kOutputs + pixel.place * kOutputs, tiles[p].to + pixel.to};
      }
    }
    next_ = 0;
  }
  __attribute__((always_inline)) void finish(Dim count, const std::array<Whole, J>& with) {
    const Dim end = std::min(next_ + count, count_);
    for (; next_ < end; ++next_) {
      const auto [sum, to] = left_[next_];
      for (int j = 0; j < J; ++j)
        with[j](_mm512_load_si512(sums_[0] + sum + j * kPixels * kOutputs),
                kNumbers ? y_ + to + j * kOutputs : nullptr, kBytes ? bytes_ + to + j * kOutputs : nullptr);
    }
  }

  alignas(64) std::int32_t sums_[4][kPixels * kOutputs];
  const ByteProductJob& job_;
  const std::span<const Dim> at_;
  const std::int8_t* const w_;
  const Dim w_row_, w_tile_;
  float* const y_;
  std::uint8_t* const bytes_;
  const Dim some_;
  std::array<Whole, J> finish_;
  struct {
    Dim sum, to;
  } left_[2 * kPixels];
  Dim count_ = 0, next_ = 0;
};

template <bool kNumbers, bool kBytes>
void all_outputs(const ByteProductJob& job, const std::uint8_t* x, std::span<const Dim> at, Dim chunk,
                 float* y, std::uint8_t* bytes) {
  Dim channel = 0;
  for (; channel + kOutputs < job.kept; channel += 2 * kOutputs)
    Outputs<2, kNumbers, kBytes>(job, at, chunk, channel, y, bytes).run(x);
  if (channel < job.kept) Outputs<1, kNumbers, kBytes>(job, at, chunk, channel, y, bytes).run(x);
}

// The longest equal parts of a segment that fit into a row of a tile.
Dim chunk_of(Dim length) {
  Dim parts = (length + kRowBytes - 1) / kRowBytes;
  while (length % (parts * kQuad) != 0) ++parts;
  return length / parts;
}

// Giving tiles their shapes takes as long as eight products of them: most jobs have those of the last.
thread_local Dim shaped_for = 0;  // chunk; 0: the tiles are released

void shape_tiles(Dim chunk) {
  if (shaped_for == chunk) return;
  const TileShapes shapes(chunk);
  _tile_loadconfig(&shapes);
  shaped_for = chunk;
}

void release_tiles() {
  if (shaped_for != 0) _tile_release();
  shaped_for = 0;
}

void run_tiles(const ByteProductJob& job, const std::uint8_t* x, float* y, std::uint8_t* bytes) {
  constexpr Dim kShortestChunk = 32, kMostParts = 64;
  const Dim chunk = chunk_of(job.length), parts = job.segment_count * job.length / chunk;
  if (job.place_count == 0 || chunk < kShortestChunk || parts > kMostParts || job.kept % kOutputs != 0)
    return kVnniByteKernels.product(job, x, y, bytes);
  Dim at[kMostParts];
  for (Dim i = 0, s = 0; s < job.segment_count; ++s) {
    for (Dim k = 0; k < job.length; k += chunk) at[i++] = job.segments[s] + k;
  }
  const std::span<const Dim> of_parts(at, static_cast<std::size_t>(parts));
  shape_tiles(chunk);
  if (y && bytes) all_outputs<true, true>(job, x, of_parts, chunk, y, bytes);
  if (y && !bytes) all_outputs<true, false>(job, x, of_parts, chunk, y, nullptr);
  if (!y) all_outputs<false, true>(job, x, of_parts, chunk, nullptr, bytes);
}

}  // namespace

const ByteKernels kAmxByteKernels{run_tiles, kVnniByteKernels.line_to_bytes, release_tiles};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
