#include "models/networks/vae.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/shaping.h"

namespace supertac {
namespace {

constexpr Dim kCoarsest = 32;  // channels of the coarsest level
constexpr Dim kHidden = 64;
constexpr Dim kDownsampling = 16;

// Channels from level to level; the encoder's first are those of the group.
constexpr Dim kDown[] = {0, 16, kCoarsest, kCoarsest, kCoarsest};
constexpr Dim kUp[] = {kCoarsest, kCoarsest, kCoarsest, 16, 16};

constexpr ConvLayerOptions kHalve{.kernel = 3, .stride = 2, .padding = 1};
constexpr ConvLayerOptions kDouble{.kernel = 4, .stride = 2, .padding = 1};

}  // namespace

Encoder::Encoder(const VaeOptions& o, Rng& rng)
    : conv_(
          add_each("conv", 4,
                   [&](Dim i) { return Conv1d(i == 0 ? o.channels : kDown[i], kDown[i + 1], kHalve, rng); })),
      fc_(add("fc", Linear(kCoarsest * (o.timesteps / kDownsampling), kHidden, rng))),
      mean_(add("mean", Linear(kHidden, o.latent, rng))),
      log_var_(add("log_var", Linear(kHidden, o.latent, rng))) {}

Variable Encoder::features(const Variable& x) const {
  Variable h = x;                                                    // [N,T,channels]
  for (const Conv1d& conv : conv_) h = conv.forward(h, kLeakyRelu);  // [N,T/2,16], ... [N,T/16,32]
  return fc_.forward(flatten_channels_first(h), kRelu);              // [N,64]
}

LatentDistribution Encoder::forward(const Variable& x) const {
  const Variable h = features(x);                                  // [N,64]
  return {mean_.forward(h), clamp(log_var_.forward(h), -10, 10)};  // [N,LD] each
}

Variable Encoder::mean(const Variable& x) const { return mean_.forward(features(x)); }

Decoder::Decoder(const VaeOptions& o, Rng& rng)
    : coarse_(o.timesteps / kDownsampling),
      widen_(add("fc.0", Linear(o.latent, kHidden, rng))),
      unfold_(add("fc.1", Linear(kHidden, kCoarsest * coarse_, rng))),
      conv_(add_each("conv", 4, [&](Dim i) { return ConvTranspose1d(kUp[i], kUp[i + 1], kDouble, rng); })),
      out_(add("out", Conv1d(kUp[4], o.channels, kSameSize, rng))) {}

Variable Decoder::forward(const Variable& z) const {
  const Dim pixels[] = {coarse_};
  const Variable wide = unfold_.forward(widen_.forward(z, kRelu), kRelu);     // [N,64], [N,32 T/16]
  Variable h = unflatten_channels_first(wide, pixels);                        // [N,T/16,32]
  for (const ConvTranspose1d& conv : conv_) h = conv.forward(h, kLeakyRelu);  // [N,T/8,32], ... [N,T,16]
  return sigmoid(out_.forward(h));                                            // [N,T,channels]
}

}  // namespace supertac
