// The register-tiled loops, written once over a vector type. Each of portable.cpp, avx2.cpp and
// avx512.cpp defines `Vec` (a value type with kLanes, load, load_part, store, store_part, broadcast,
// fma) and kTilePixels in an anonymous namespace, then includes this file.
//
// Nothing here may call an inline function that is not inlined for sure (these files are always built
// with -O3): the linker keeps one copy of it, which might then run on a processor without these instructions.

// One tile: P pixels by J vectors of output channels stay in registers while taps and input channels
// stream past. Each output is one accumulator; its sum runs over taps, then input channels.
template <int P, int J, bool kPartial>
inline void gather_tile(const GatherJob& job, const std::int32_t* taps, Dim tap_count,
                        const std::int32_t* outputs, const std::int32_t* sources, const real* zeros,
                        const real* x, real* y, Dim channel) {
  const Dim lanes = job.cout - channel - (J - 1) * Vec::kLanes;  // of the last vector; used when kPartial
  Vec acc[P][J];
  for (int p = 0; p < P; ++p) {
    const real* from = job.accumulate ? y + outputs[p] * job.cout + channel
                       : job.bias     ? job.bias + channel
                                      : nullptr;
    for (int j = 0; j < J; ++j) {
      if (from == nullptr) {
        acc[p][j] = Vec::broadcast(0);
      } else if (kPartial && j == J - 1) {
        acc[p][j] = Vec::load_part(from + j * Vec::kLanes, lanes);
      } else {
        acc[p][j] = Vec::load(from + j * Vec::kLanes);
      }
    }
  }
  for (Dim t = 0; t < tap_count; ++t) {
    const real* pixel[P];
    bool any = false;
    for (int p = 0; p < P; ++p) {
      const std::int32_t source = sources[p * tap_count + t];
      any = any || source >= 0;
      pixel[p] = source >= 0 ? x + source * job.cin : zeros;
    }
    if (!any) continue;
    const real* w = job.w + taps[t] * job.cin * job.cout + channel;
    for (Dim c = 0; c < job.cin; ++c, w += job.cout) {
      Vec weight[J];
      for (int j = 0; j < J; ++j) {
        weight[j] = kPartial && j == J - 1 ? Vec::load_part(w + j * Vec::kLanes, lanes)
                                           : Vec::load(w + j * Vec::kLanes);
      }
      for (int p = 0; p < P; ++p) {
        const Vec value = Vec::broadcast(pixel[p][c]);
        for (int j = 0; j < J; ++j) acc[p][j] = Vec::fma(value, weight[j], acc[p][j]);
      }
    }
  }
  // + 0 turns -0 into +0: a sum of -0 changes its sign where 0 * w is added for a tap in the padding, and not
  // where the tap is skipped, which depends on how many pixels share a tile.
  for (int p = 0; p < P; ++p) {
    real* to = y + outputs[p] * job.cout + channel;
    for (int j = 0; j < J; ++j) {
      acc[p][j] = Vec::add(acc[p][j], Vec::broadcast(0));
      if (kPartial && j == J - 1) {
        acc[p][j].store_part(to + j * Vec::kLanes, lanes);
      } else {
        acc[p][j].store(to + j * Vec::kLanes);
      }
    }
  }
}

template <int P>
inline void gather_channels(const GatherJob& job, const std::int32_t* taps, Dim tap_count,
                            const std::int32_t* outputs, const std::int32_t* sources, const real* zeros,
                            const real* x, real* y) {
  constexpr int kWide = P == 1 ? 4 : 2;  // a single pixel needs more vectors to hide the latency of FMA
  Dim channel = 0;
  if constexpr (kWide == 4) {
    for (; channel + 4 * Vec::kLanes <= job.cout; channel += 4 * Vec::kLanes) {
      gather_tile<P, 4, false>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
    }
  }
  for (; channel + 2 * Vec::kLanes <= job.cout; channel += 2 * Vec::kLanes) {
    gather_tile<P, 2, false>(job, taps, tap_count, outputs, sources, zeros, x, y, channel);
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

void gather(const GatherJob& job, const real* x, real* y) {
  const Phase* phase = job.phases->data();
  for (std::size_t i = 0; i < job.phases->size(); ++i, ++phase) {
    gather_pixels(job, phase->taps.data(), static_cast<Dim>(phase->taps.size()), phase->outputs.data(),
                  phase->sources.data(), static_cast<Dim>(phase->outputs.size()), kZeros, x, y);
  }
}

const std::int32_t kFirstTap[1] = {0};
const std::int32_t kRowNumbers[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

void gather_rows(const GatherJob& job, const real* x, real* y, Dim rows) {
  for (Dim row = 0; row < rows; row += 16) {
    const Dim count = rows - row < 16 ? rows - row : 16;
    gather_pixels(job, kFirstTap, 1, kRowNumbers, kRowNumbers, count, nullptr, x + row * job.cin,
                  y + row * job.cout);
  }
}

// R rows of gw (values of cin) by J vectors of cout; the pairs stream past.
template <int R, int J, bool kPartial>
inline void outer_tile(const OuterJob& job, Dim row, Dim channel, Dim first_image, Dim last_image) {
  const Dim lanes = job.cout - channel - (J - 1) * Vec::kLanes;
  const std::int32_t* inputs = job.pairs->inputs.data();
  const std::int32_t* outputs = job.pairs->outputs.data();
  const Dim count = static_cast<Dim>(job.pairs->inputs.size());
  Vec acc[R][J];
  for (int r = 0; r < R; ++r) {
    for (int j = 0; j < J; ++j) acc[r][j] = Vec::broadcast(0);
  }
  for (Dim image = first_image; image < last_image; ++image) {
    const real* x = job.x + image * job.in_pixels * job.cin + row;
    const real* gy = job.gy + image * job.out_pixels * job.cout + channel;
    for (Dim i = 0; i < count; ++i) {
      const real* g = gy + outputs[i] * job.cout;
      const real* v = x + inputs[i] * job.cin;
      Vec grad[J];
      for (int j = 0; j < J; ++j) {
        grad[j] = kPartial && j == J - 1 ? Vec::load_part(g + j * Vec::kLanes, lanes)
                                         : Vec::load(g + j * Vec::kLanes);
      }
      for (int r = 0; r < R; ++r) {
        const Vec value = Vec::broadcast(v[r]);
        for (int j = 0; j < J; ++j) acc[r][j] = Vec::fma(value, grad[j], acc[r][j]);
      }
    }
  }
  for (int r = 0; r < R; ++r) {
    real* to = job.gw + (row + r) * job.cout + channel;
    for (int j = 0; j < J; ++j, to += Vec::kLanes) {
      if (kPartial && j == J - 1) {
        Vec::add(Vec::load_part(to, lanes), acc[r][j]).store_part(to, lanes);
      } else {
        Vec::add(Vec::load(to), acc[r][j]).store(to);
      }
    }
  }
}

template <int R>
inline void outer_channels(const OuterJob& job, Dim row, Dim first_image, Dim last_image) {
  Dim channel = 0;
  for (; channel + 2 * Vec::kLanes <= job.cout; channel += 2 * Vec::kLanes) {
    outer_tile<R, 2, false>(job, row, channel, first_image, last_image);
  }
  for (; channel + Vec::kLanes <= job.cout; channel += Vec::kLanes) {
    outer_tile<R, 1, false>(job, row, channel, first_image, last_image);
  }
  if (channel < job.cout) outer_tile<R, 1, true>(job, row, channel, first_image, last_image);
}

void outer(const OuterJob& job, Dim row) {
  for (Dim image = 0; image < job.images; image += job.chunk) {
    const Dim last = image + job.chunk < job.images ? image + job.chunk : job.images;
    if (row + kOuterRows <= job.cin) {
      outer_channels<kOuterRows>(job, row, image, last);
    } else {
      for (Dim r = row; r < job.cin; ++r) outer_channels<1>(job, r, image, last);
    }
  }
}
