#include "models/networks/vae.h"

#include "autograd/ops/activations.h"
#include "autograd/ops/shaping.h"

namespace supertac {
namespace {

constexpr Dim kFeatures = 32;  // channels of the coarsest level
constexpr Dim kHidden = 64;
constexpr Dim kDownsampling = 16;

constexpr ConvLayerOptions kHalve{.kernel = 3, .stride = 2, .padding = 1};
constexpr ConvLayerOptions kDouble{.kernel = 4, .stride = 2, .padding = 1};

}  // namespace

Encoder::Encoder(const VaeOptions& o, Rng& rng)
    : conv_{{o.channels, 16, kHalve, rng},
            {16, kFeatures, kHalve, rng},
            {kFeatures, kFeatures, kHalve, rng},
            {kFeatures, kFeatures, kHalve, rng}},
      fc_(kFeatures * (o.timesteps / kDownsampling), kHidden, rng),
      mean_(kHidden, o.latent, rng),
      log_var_(kHidden, o.latent, rng) {
  for (std::size_t i = 0; i < conv_.size(); ++i) add("conv." + std::to_string(i), conv_[i]);
  add("fc", fc_);
  add("mean", mean_);
  add("log_var", log_var_);
}

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
      widen_(o.latent, kHidden, rng),
      unfold_(kHidden, kFeatures * coarse_, rng),
      conv_{{kFeatures, kFeatures, kDouble, rng},
            {kFeatures, kFeatures, kDouble, rng},
            {kFeatures, 16, kDouble, rng},
            {16, 16, kDouble, rng}},
      out_(16, o.channels, kSameSize, rng) {
  add("fc.0", widen_);
  add("fc.1", unfold_);
  for (std::size_t i = 0; i < conv_.size(); ++i) add("conv." + std::to_string(i), conv_[i]);
  add("out", out_);
}

Variable Decoder::forward(const Variable& z) const {
  const Dim pixels[] = {coarse_};
  const Variable wide = unfold_.forward(widen_.forward(z, kRelu), kRelu);     // [N,LD], [N,64], [N,32 T/16]
  Variable h = unflatten_channels_first(wide, pixels);                        // [N,T/16,32]
  for (const ConvTranspose1d& conv : conv_) h = conv.forward(h, kLeakyRelu);  // [N,T/8,32], ... [N,T,16]
  return sigmoid(out_.forward(h));                                            // [N,T,channels]
}

}  // namespace supertac
