#include "autograd/kernels/fast/int8/numbers.h"

#include <algorithm>

#include "autograd/kernels/exp.h"
#include "autograd/kernels/fast/each.h"

namespace supertac::kernels {
namespace {

template <class Whole>
std::int16_t clip(Whole v) {
  return static_cast<std::int16_t>(v < -32768 ? -32768 : v > 32767 ? 32767 : v);
}

std::int16_t finish(const Outcome& to, Dim o, std::int32_t sum) {
  const std::int32_t v = clip((std::int64_t{sum} * to.multiplier[o] + to.offset[o]) >> to.shift[o]);
  if (to.negative_slope == Outcome::kNoSlope) return clip(v);
  return clip(std::max(v, (v * to.negative_slope + Outcome::kSlopeHalf) >> Outcome::kSlopeBits));
}

constexpr Dim kMostWidened = 4096;

// Of one output, such as a picture's: neighbours of x meet neighbours of w, which are widened once.
void product_of_one(const ByteProductJob& job, const std::int16_t* x, std::int16_t* y) {
  std::int16_t wide[kMostWidened];
  std::copy_n(job.w, job.segment_count * job.length, wide);
  run_loop([&job, x, y, &wide] {
    for (Dim n = 0; n < job.images; ++n)
      for (Dim i = 0; i < job.height; ++i)
        for (Dim j = 0; j < job.width; ++j) {
          const std::int16_t* from = x + n * job.from.image + i * job.from.line + j * job.from.pixel;
          const std::int16_t* w = wide;
          std::int32_t sum = 0;
          for (Dim s = 0; s < job.segment_count; ++s, w += job.length) {
            const std::int16_t* const v = from + job.segments[s];
            for (Dim k = 0; k < job.length; ++k) sum += static_cast<std::int32_t>(v[k]) * w[k];
          }
          y[n * job.to.image + i * job.to.line + j * job.to.pixel] = finish(job.outcome, 0, sum);
        }
  });
}

// Of `count` outputs from `first` on.
void sums(const ByteProductJob& job, const std::int16_t* x, Dim first, Dim count, std::int32_t* sum) {
  std::fill_n(sum, count, 0);
  run_loop([&job, x, first, count, sum] {
    const std::int8_t* w = job.w + first;
    for (Dim s = 0; s < job.segment_count; ++s) {
      for (Dim k = 0; k < job.length; ++k, w += job.cout) {
        const std::int32_t v = x[job.segments[s] + k];
        const std::int8_t* const row = w;
        each_here(count, [=](Dim o) { sum[o] += v * row[o]; });
      }
    }
  });
}

}  // namespace

void product_of_numbers(const ByteProductJob& job, const std::int16_t* x, std::int16_t* y) {
  if (job.cout == 1 && job.segment_count * job.length <= kMostWidened) return product_of_one(job, x, y);
  std::int32_t sum[kMaxChannels];  // a linear layer has more outputs: channels of all pixels
  for (Dim n = 0; n < job.images; ++n) {
    for (Dim i = 0; i < job.height; ++i) {
      for (Dim j = 0; j < job.width; ++j) {
        const std::int16_t* from = x + n * job.from.image + i * job.from.line + j * job.from.pixel;
        std::int16_t* to = y + n * job.to.image + i * job.to.line + j * job.to.pixel;
        for (Dim first = 0; first < job.cout; first += kMaxChannels) {
          const Dim count = std::min(kMaxChannels, job.cout - first);
          sums(job, from, first, count, sum);
          for (Dim o = 0; o < count; ++o) to[first + o] = finish(job.outcome, first + o, sum[o]);
        }
      }
    }
  }
}

void means(Dim height, Dim width, Dim channels, Dim line, const std::int16_t* x, std::int16_t* y) {
  const auto pixels = static_cast<std::int32_t>(height * width);
  constexpr Dim kAtOnce = 64;
  for (Dim first = 0; first < channels; first += kAtOnce) {
    const Dim count = std::min(kAtOnce, channels - first);
    run_loop([=] {
      std::int32_t sum[kAtOnce] = {};
      for (Dim i = 0; i < height; ++i)
        for (Dim j = 0; j < width; ++j) {
          const std::int16_t* const pixel = x + i * line + j * channels + first;
          each_here(count, [&sum, pixel](Dim c) { sum[c] += pixel[c]; });
        }
      for (Dim c = 0; c < count; ++c)
        y[first + c] =
            static_cast<std::int16_t>((sum[c] < 0 ? sum[c] - pixels / 2 : sum[c] + pixels / 2) / pixels);
    });
  }
}

void to_bytes(Dim n, const std::int16_t* x, std::int32_t multiplier, std::int32_t offset, std::int32_t shift,
              std::int32_t zero, std::uint8_t* y) {
  each(n, [=](Dim i) {
    const std::int32_t v = ((x[i] * multiplier + offset) >> shift) + zero;
    y[i] = static_cast<std::uint8_t>(v < 0 ? 0 : v > 255 ? 255 : v);
  });
}

void to_numbers(Dim n, const float* x, float per_step, std::int16_t* y) {
  each(n, [=](Dim i) {
    float v = x[i] * per_step;
    v = v > -32768.0F ? v : -32768.0F;  // not a number counts as the least
    v = v < 32767.0F ? v : 32767.0F;
    y[i] = static_cast<std::int16_t>(static_cast<std::int32_t>(v + 32768.5F) - 32768);
  });
}

void gated_sum(Dim pixels, Dim channels, const std::int16_t* a, const std::int16_t* x,
               const std::int16_t* gates, std::int16_t* y) {
  if (gates == nullptr)
    return each(pixels * channels, [=](Dim i) { y[i] = clip(std::int32_t{a[i]} + x[i]); });
  run_loop([=] {
    for (Dim p = 0; p < pixels; ++p) {
      const std::int16_t *b = a + p * channels, *h = x + p * channels;
      std::int16_t* const to = y + p * channels;
      each_here(channels, [=](Dim c) { to[c] = clip(b[c] + ((h[c] * gates[c] + 2048) >> kGateBits)); });
    }
  });
}

void gates(Dim n, const std::int16_t* x, float step, std::int16_t* y) {
  for (Dim i = 0; i < n; ++i) {
    const auto gate =
        static_cast<float>(sigmoid_same_bits(static_cast<real>(static_cast<float>(x[i]) * step)));
    y[i] = static_cast<std::int16_t>(gate * 4096.0F + 0.5F);
  }
}

}  // namespace supertac::kernels
