#include "layers/residual.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/record.h"

namespace supertac {

static Dim squeezed(Dim channels, Dim reduction) {
  if (reduction < 1 || reduction > channels)
    refuse("ChannelAttention", "reduction", "1 to the " + std::to_string(channels) + " channels",
           std::to_string(reduction));
  return channels / reduction;
}

ChannelAttention::ChannelAttention(Dim channels, Dim reduction, Rng& rng)
    : squeeze_(add("squeeze", Linear(channels, squeezed(channels, reduction), rng, Layout::pointwise))),
      expand_(add("expand", Linear(channels / reduction, channels, rng, Layout::pointwise))) {}

Variable ChannelAttention::gates(const Variable& x) const {
  const Variable mean = global_mean(x);                            // [N,H,W,C] -> [N,C]
  return sigmoid(expand_.forward(squeeze_.forward(mean, kRelu)));  // [N,C/reduction], [N,C]
}

Rcab::Rcab(Dim channels, Dim reduction, Rng& rng)
    : first_(add("conv.0", Conv2d(channels, channels, kSameSize, rng))),
      second_(add("conv.1", Conv2d(channels, channels, kSameSize, rng))),
      attention_(add("attention", ChannelAttention(channels, reduction, rng))) {}

Variable Rcab::forward(const Variable& x) const {
  const Variable h = second_.forward(first_.forward(x, kRelu));  // [N,H,W,C], as x and the result
  return gated_sum(x, h, attention_.gates(h));                   // gates [N,C]
}

Rirb::Rirb(const RirbOptions& o, Rng& rng)
    : blocks_(add_each("rcab", o.blocks, [&](Dim) { return Rcab(o.channels, o.reduction, rng); })),
      conv_(add("conv", Conv2d(o.channels, o.channels, kSameSize, rng))),
      up_(add("up", ConvTranspose2d(o.channels, o.channels, {.kernel = 4, .stride = 2, .padding = 1}, rng))) {
}

Variable Rirb::forward(const Variable& x) const {
  Variable h = x;  // [N,H,W,C], and so is each sum
  for (const Rcab& block : blocks_) h = block.forward(h);
  return up_.forward(x + conv_.forward(h), kLeakyRelu);  // [N,2H,2W,C]
}

}  // namespace supertac
