#include "layers/residual.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/record.h"

namespace supertac {

static constexpr Dim kReduction = 4;  // of channels, in between

static Dim squeezed(Dim channels) {
  if (channels < kReduction) refuse("ChannelAttention", "channels", "4 or more", std::to_string(channels));
  return channels / kReduction;
}

ChannelAttention::ChannelAttention(Dim channels, Rng& rng)
    : squeeze_(add("squeeze", Linear(channels, squeezed(channels), rng, Layout::pointwise))),
      expand_(add("expand", Linear(channels / kReduction, channels, rng, Layout::pointwise))) {}

Variable ChannelAttention::gates(const Variable& x) const {
  const Variable mean = global_mean(x);                            // [N,H,W,C] -> [N,C]
  return sigmoid(expand_.forward(squeeze_.forward(mean, kRelu)));  // [N,C/4], [N,C]
}

Rcab::Rcab(Dim channels, Rng& rng)
    : first_(add("conv.0", Conv2d(channels, channels, kSameSize, rng))),
      second_(add("conv.1", Conv2d(channels, channels, kSameSize, rng))),
      attention_(add("attention", ChannelAttention(channels, rng))) {}

Variable Rcab::forward(const Variable& x) const {
  const Variable h = second_.forward(first_.forward(x, kRelu));  // [N,H,W,C], as x and the result
  return gated_sum(x, h, attention_.gates(h));                   // gates [N,C]
}

Rirb::Rirb(Dim channels, Dim blocks, Rng& rng)
    : blocks_(add_each("rcab", blocks, [&](Dim) { return Rcab(channels, rng); })),
      conv_(add("conv", Conv2d(channels, channels, kSameSize, rng))),
      up_(add("up", ConvTranspose2d(channels, channels, {.kernel = 4, .stride = 2, .padding = 1}, rng))) {}

Variable Rirb::forward(const Variable& x) const {
  Variable h = x;  // [N,H,W,C], and so is each sum
  for (const Rcab& block : blocks_) h = block.forward(h);
  return up_.forward(x + conv_.forward(h), kLeakyRelu);  // [N,2H,2W,C]
}

}  // namespace supertac
