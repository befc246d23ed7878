#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <array>

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

// Sixteen pixels one after another.
struct Pixels {
  std::array<const std::uint8_t*, kPixels> x;
  std::array<Dim, kPixels> to;
  Dim count = 0;
};

class PixelCursor {
 public:
  PixelCursor(const ByteProductJob& job, const std::uint8_t* x)
      : job_(job), x_(x), left_(job.images * job.height * job.width) {}
  Dim left() const { return left_; }

  Pixels next() {
    Pixels pixels;
    pixels.count = std::min(kPixels, left_);
    for (Dim p = 0; p < kPixels; ++p) {  // a pixel too many is the last one again
      pixels.x[static_cast<std::size_t>(p)] = x_, pixels.to[static_cast<std::size_t>(p)] = to_;
      if (left_ > 1) step();
      if (p < pixels.count) --left_;
    }
    return pixels;
  }

 private:
  void step() {
    x_ += job_.from.pixel, to_ += job_.to.pixel;
    if (++column_ < job_.width) return;
    x_ += job_.from.line - job_.width * job_.from.pixel, to_ += job_.to.line - job_.width * job_.to.pixel;
    column_ = 0;
    if (++line_ < job_.height) return;
    x_ += job_.from.image - job_.height * job_.from.line, to_ += job_.to.image - job_.height * job_.to.line;
    line_ = 0;
  }

  const ByteProductJob& job_;
  const std::uint8_t* x_;
  Dim left_, to_ = 0, column_ = 0, line_ = 0;
};

// What all outputs of some pixels see, a tile of rows after another: pixels of a small map are not equally
// far from each other.
class Rows {
 public:
  static constexpr Dim kMostTiles = 64;

  void gather(const ByteProductJob& job, const Pixels& pixels, Dim chunk) {
    const auto quads = mask_of(chunk / kQuad);
    std::uint8_t* to = bytes_;
    for (Dim s = 0; s < job.segment_count; ++s) {
      for (Dim k = 0; k < job.length; k += chunk, to += kTile) {
        const Dim at = job.segments[s] + k;
        for (std::size_t p = 0; p < kPixels; ++p)
          _mm512_store_si512(to + p * kRowBytes, _mm512_maskz_loadu_epi32(quads, pixels.x[p] + at));
      }
    }
  }
  const std::uint8_t* tile(Dim i) const { return bytes_ + i * kTile; }

 private:
  static constexpr Dim kTile = kPixels * kRowBytes;
  alignas(64) std::uint8_t bytes_[kMostTiles * kTile];
};

// Sums of P times sixteen pixels and J times sixteen outputs.
template <int P, int J>
void sum_tiles(const Rows (&rows)[P], Dim tiles, const std::int8_t* w, Dim w_row, Dim w_tile) {
  _tile_zero(0);
  if constexpr (J == 2) _tile_zero(1);
  if constexpr (P == 2) _tile_zero(2);
  if constexpr (P == 2 && J == 2) _tile_zero(3);
  for (Dim i = 0; i < tiles; ++i, w += w_tile) {
    _tile_loadd(6, w, w_row);
    _tile_loadd(4, rows[0].tile(i), kRowBytes);
    _tile_dpbusd(0, 4, 6);
    if constexpr (J == 2) _tile_loadd(7, w + kOutputs * kQuad, w_row);
    if constexpr (J == 2) _tile_dpbusd(1, 4, 7);
    if constexpr (P == 2) {
      _tile_loadd(5, rows[1].tile(i), kRowBytes);
      _tile_dpbusd(2, 5, 6);
      if constexpr (J == 2) _tile_dpbusd(3, 5, 7);
    }
  }
}

void finish_tile(const ByteProductJob& job, const std::int32_t* sums, const Pixels& pixels, Dim channel,
                 float* y, std::uint8_t* bytes) {
  if (channel >= job.kept) return;
  const Finish finish(job.outcome, channel, job.kept - channel);
  for (Dim p = 0; p < pixels.count; ++p) {
    const Dim at = pixels.to[static_cast<std::size_t>(p)] + channel;
    finish(_mm512_load_si512(sums + p * kOutputs), y ? y + at : nullptr, bytes ? bytes + at : nullptr);
  }
}

template <int P, int J>
void outputs_from(const ByteProductJob& job, const Pixels (&pixels)[P], const Rows (&rows)[P], Dim chunk,
                  Dim channel, float* y, std::uint8_t* bytes) {
  alignas(64) std::int32_t sums[4][kPixels * kOutputs];
  const Dim tiles = job.segment_count * job.length / chunk;
  sum_tiles<P, J>(rows, tiles, job.w + channel * kQuad, job.cout * kQuad, chunk * job.cout);
  _tile_stored(0, sums[0], kRowBytes);
  if constexpr (J == 2) _tile_stored(1, sums[1], kRowBytes);
  if constexpr (P == 2) _tile_stored(2, sums[2], kRowBytes);
  if constexpr (P == 2 && J == 2) _tile_stored(3, sums[3], kRowBytes);
  for (int p = 0; p < P; ++p) {
    for (int j = 0; j < J; ++j)
      finish_tile(job, sums[2 * p + j], pixels[p], channel + j * kOutputs, y, bytes);
  }
}

template <int P>
void all_outputs(const ByteProductJob& job, const Pixels (&pixels)[P], Dim chunk, float* y,
                 std::uint8_t* bytes) {
  Rows rows[P];
  for (int p = 0; p < P; ++p) rows[p].gather(job, pixels[p], chunk);
  Dim channel = 0;
  for (; channel + 2 * kOutputs <= job.cout; channel += 2 * kOutputs)
    outputs_from<P, 2>(job, pixels, rows, chunk, channel, y, bytes);
  if (channel < job.cout) outputs_from<P, 1>(job, pixels, rows, chunk, channel, y, bytes);
}

// The longest equal parts of a segment that fit into a row of a tile.
Dim chunk_of(Dim length) {
  Dim parts = (length + kRowBytes - 1) / kRowBytes;
  while (length % (parts * kQuad) != 0) ++parts;
  return length / parts;
}

void run_tiles(const ByteProductJob& job, const std::uint8_t* x, float* y, std::uint8_t* bytes) {
  constexpr Dim kFewestPixels = 8, kShortestChunk = 32;
  const Dim chunk = chunk_of(job.length);
  PixelCursor cursor(job, x);
  if (cursor.left() < kFewestPixels || chunk < kShortestChunk ||
      job.segment_count * job.length > chunk * Rows::kMostTiles)
    return kVnniByteKernels.product(job, x, y, bytes);
  const TileShapes shapes(chunk);
  _tile_loadconfig(&shapes);
  while (cursor.left() > kPixels) {
    const Pixels first = cursor.next();
    all_outputs<2>(job, {first, cursor.next()}, chunk, y, bytes);
  }
  if (cursor.left() > 0) all_outputs<1>(job, {cursor.next()}, chunk, y, bytes);
  _tile_release();
}

}  // namespace

const ByteKernels kAmxByteKernels{run_tiles, kVnniByteKernels.line_to_bytes};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
