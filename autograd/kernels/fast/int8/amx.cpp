#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <algorithm>
#include <array>
#include <span>

#include "autograd/kernels/fast/int8/finish512.h"

// Tiles of the processor: the bytes of a place are a row of A, four bytes of sixteen outputs a row of B, and
// one instruction adds A B to a tile of 16 x 16 sums.
namespace supertac::kernels {
namespace {

constexpr int kPlaces = 16;
constexpr Dim kOutputs = 16, kRowBytes = 64;

// Tiles 0 to 3 are sums, [places][outputs]; 4 and 5 hold places, 6 and 7 weights.
struct alignas(64) TileShapes {
  explicit TileShapes(Dim chunk) {
    for (const std::size_t sums : {0, 1, 2, 3}) row_bytes[sums] = kRowBytes, rows[sums] = kPlaces;
    for (const std::size_t x : {4, 5}) row_bytes[x] = static_cast<std::uint16_t>(chunk), rows[x] = kPlaces;
    for (const std::size_t w : {6, 7})
      row_bytes[w] = kRowBytes, rows[w] = static_cast<std::uint8_t>(chunk / kQuad);
  }
  std::uint8_t palette = 1, start_row = 0, reserved[14] = {};
  std::array<std::uint16_t, 16> row_bytes{};
  std::array<std::uint8_t, 16> rows{};
};

// A product of J times sixteen outputs from `channel` on. Two times sixteen places are summed at a time, and
// those before finished in the meantime: tiles work beside vectors, but only as far as the processor looks
// ahead.
template <int J, bool kNumbers>
class TiledProduct {
 public:
  TiledProduct(const ByteProductJob& job, std::span<const Dim> parts, Dim chunk, Dim channel, std::int16_t* y,
               std::uint8_t* bytes)
      : job_(job),
        parts_(parts),
        w_(job.w + channel * kQuad),
        w_part_(chunk * job.cout),
        y_(kNumbers ? y + channel : nullptr),
        bytes_(kNumbers ? nullptr : bytes + channel),
        pixels_of_part_(kPlaces / static_cast<std::int32_t>(parts.size()) + 1) {
    for (int j = 0; j < J; ++j) finish_[j] = Finish(job.outcome, channel + j * kOutputs);
  }

  void run(const std::uint8_t* x) {
    Dim tiles = job_.images * job_.place_count;
    for (; tiles >= 2; tiles -= 2) run_tiles<2>(x);
    if (tiles > 0) run_tiles<1>(x);
    finish(kPlaces, finish_);
  }

 private:
  // The next P.
  template <int P>
  void run_tiles(const std::uint8_t* x) {
    Waiting next[2] = {};
    const std::uint8_t* rows[P];
    for (int p = 0; p < P; ++p) {
      next[p] = {job_.places + place_, image_ * job_.to.image};
      rows[p] = x + image_ * job_.from.image + next[p].places->x;
      if (++place_ == job_.place_count) place_ = 0, ++image_;
    }
    sum(rows);
    waiting_[0] = next[0], waiting_[1] = next[1];
    done_ = 0;
  }

  // Behind this the sums before are finished.
  template <int P>
  __attribute__((always_inline)) void sum(const std::uint8_t* const (&rows)[P]) {
    const std::array<Finish, J> with = finish_;  // in registers
    const Dim row = job_.from.pixel, w_row = job_.cout * kQuad;
    const std::int8_t* w = w_;
    _tile_zero(0);
    if constexpr (J == 2) _tile_zero(1);
    if constexpr (P == 2) _tile_zero(2);
    if constexpr (P == 2 && J == 2) _tile_zero(3);
    for (const Dim part : parts_) {
      _tile_loadd(6, w, w_row);
      _tile_loadd(4, rows[0] + part, row);
      _tile_dpbusd(0, 4, 6);
      if constexpr (J == 2) _tile_loadd(7, w + kOutputs * kQuad, w_row);
      if constexpr (J == 2) _tile_dpbusd(1, 4, 7);
      if constexpr (P == 2) _tile_loadd(5, rows[1] + part, row);
      if constexpr (P == 2) _tile_dpbusd(2, 5, 6);
      if constexpr (P == 2 && J == 2) _tile_dpbusd(3, 5, 7);
      finish(pixels_of_part_, with);
      w += w_part_;
    }
    finish(kPlaces, with);
    _tile_stored(0, sums_[0], kRowBytes);
    if constexpr (J == 2) _tile_stored(1, sums_[1], kRowBytes);
    if constexpr (P == 2) _tile_stored(2, sums_[2], kRowBytes);
    if constexpr (P == 2 && J == 2) _tile_stored(3, sums_[3], kRowBytes);
  }

  // So many pixels of each of the places that wait.
  __attribute__((always_inline)) void finish(std::int32_t pixels, const std::array<Finish, J>& with) {
    for (int p = 0; p < 2; ++p) {
      if (waiting_[p].places == nullptr) continue;
      const auto& [places, image] = waiting_[p];
      for (std::int32_t i = done_; i < std::min(done_ + pixels, places->count); ++i) {
        const BytePlaces::Pixel& pixel = places->pixels[static_cast<std::size_t>(i)];
        const Dim to = image + pixel.to;
        for (int j = 0; j < J; ++j)
          with[j](_mm512_load_si512(sums_[2 * p + j] + pixel.place * kOutputs),
                  kNumbers ? y_ + to + j * kOutputs : nullptr,
                  kNumbers ? nullptr : bytes_ + to + j * kOutputs);
      }
    }
    done_ += pixels;
  }

  struct Waiting {
    const BytePlaces* places = nullptr;
    Dim to = 0;  // of the image
  };
  alignas(64) std::int32_t sums_[4][kPlaces * kOutputs];  // of tiles 0 to 3: [two of places][two of outputs]
  const ByteProductJob& job_;
  const std::span<const Dim> parts_;
  const std::int8_t* const w_;
  const Dim w_part_;
  std::int16_t* const y_;
  std::uint8_t* const bytes_;
  const std::int32_t pixels_of_part_;
  std::array<Finish, J> finish_;
  Waiting waiting_[2];
  std::int32_t done_ = 0;  // pixels of each
  Dim image_ = 0, place_ = 0;
};

template <bool kNumbers>
void all_outputs(const ByteProductJob& job, const std::uint8_t* x, std::span<const Dim> parts, Dim chunk,
                 std::int16_t* y, std::uint8_t* bytes) {
  Dim channel = 0;
  for (; channel + kOutputs < job.kept; channel += 2 * kOutputs)
    TiledProduct<2, kNumbers>(job, parts, chunk, channel, y, bytes).run(x);
  if (channel < job.kept) TiledProduct<1, kNumbers>(job, parts, chunk, channel, y, bytes).run(x);
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

void run(const ByteProductJob& job, const std::uint8_t* x, std::int16_t* y, std::uint8_t* bytes) {
  constexpr Dim kShortestChunk = 32, kMostParts = 64;
  const Dim chunk = chunk_of(job.length), count = job.segment_count * job.length / chunk;
  if (job.place_count == 0 || chunk < kShortestChunk || count > kMostParts || job.kept % kOutputs != 0)
    return kVnniByteKernels.product(job, x, y, bytes);
  Dim offsets[kMostParts];
  for (Dim i = 0, s = 0; s < job.segment_count; ++s) {
    for (Dim k = 0; k < job.length; k += chunk) offsets[i++] = job.segments[s] + k;
  }
  const std::span<const Dim> parts(offsets, static_cast<std::size_t>(count));
  shape_tiles(chunk);
  if (y != nullptr) return all_outputs<true>(job, x, parts, chunk, y, bytes);
  all_outputs<false>(job, x, parts, chunk, y, bytes);
}

}  // namespace

const ByteKernels kAmxByteKernels{run, true, release_tiles};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
