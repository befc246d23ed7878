#include "layers/residual.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/attention.h"
#include "autograd/record.h"

namespace supertac {
namespace {

Dim squeezed(Dim channels, Dim reduction) {
  if (reduction < 1 || reduction > channels)
    refuse("ChannelAttention", "reduction", "1 to the " + std::to_string(channels) + " channels",
           std::to_string(reduction));
  return channels / reduction;
}

std::vector<Rcab> make_blocks(const RirbOptions& options, Rng& rng) {
  std::vector<Rcab> blocks;
  for (Dim i = 0; i < options.blocks; ++i) blocks.emplace_back(options.channels, options.reduction, rng);
  return blocks;
}

}  // namespace

ChannelAttention::ChannelAttention(Dim channels, Dim reduction, Rng& rng)
    : squeeze_(channels, squeezed(channels, reduction), rng, Layout::pointwise),
      expand_(channels / reduction, channels, rng, Layout::pointwise) {
  add("squeeze", squeeze_);
  add("expand", expand_);
}

Variable ChannelAttention::gates(const Variable& x) const {
  const Variable mean = global_mean(x);                            // [N,H,W,C] -> [N,C]
  return sigmoid(expand_.forward(squeeze_.forward(mean, kRelu)));  // [N,C/reduction], [N,C]
}

Rcab::Rcab(Dim channels, Dim reduction, Rng& rng)
    : first_(channels, channels, kSameSize, rng),
      second_(channels, channels, kSameSize, rng),
      attention_(channels, reduction, rng) {
  add("conv.0", first_);
  add("conv.1", second_);
  add("attention", attention_);
}

Variable Rcab::forward(const Variable& x) const {
  const Variable h = second_.forward(first_.forward(x, kRelu));  // [N,H,W,C], as x and the result
  return gated_sum(x, h, attention_.gates(h));                   // gates [N,C]
}

Rirb::Rirb(const RirbOptions& options, Rng& rng)
    : blocks_(make_blocks(options, rng)),
      conv_(options.channels, options.channels, kSameSize, rng),
      up_(options.channels, options.channels, {.kernel = 4, .stride = 2, .padding = 1}, rng) {
  for (std::size_t i = 0; i < blocks_.size(); ++i) add("rcab." + std::to_string(i), blocks_[i]);
  add("conv", conv_);
  add("up", up_);
}

Variable Rirb::forward(const Variable& x) const {
  Variable h = x;  // [N,H,W,C], and so is each sum
  for (const Rcab& block : blocks_) h = block.forward(h);
  return up_.forward(x + conv_.forward(h), kLeakyRelu);  // [N,2H,2W,C]
}

}  // namespace supertac
