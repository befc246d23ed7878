// The variational auto-encoder that squeezes one group of taxels into a few latent numbers (Kingma & Welling
// 2014).
#pragma once

#include <vector>

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

struct VaeOptions {
  Dim timesteps = 256;  ///< T, a multiple of 16 (SuperTacSettings::check())
  Dim channels = 4;     ///< signals of the group: C below
  Dim latent = 10;      ///< LD
};

/// The distribution N(mean, exp(log_var)) of the latent vector, each [N,LD]; log_var is clamped to [-10,10].
struct LatentDistribution {
  Variable mean, log_var;
};

/// x [N,T,C] -> four convolutions (kernel 3, stride 2, leaky ReLU) to 16, 32, 32, 32 channels, [N,T/16,32] ->
/// linear layer to 64, ReLU -> linear layers to mean and log variance.
class Encoder : public Module {
 public:
  /// The options are not checked, here and below: SuperTacSettings (supertac_model.h) has been.
  Encoder(const VaeOptions& options, Rng& rng);
  LatentDistribution forward(const Variable& x) const;
  /// The mean alone: what evaluation uses.
  Variable mean(const Variable& x) const;

 private:
  Variable features(const Variable& x) const;
  std::vector<Conv1d> conv_;
  Linear fc_, mean_, log_var_;
};

/// z [N,LD] -> linear layers to 64 and [N,T/16,32], ReLU -> four transposed convolutions (kernel 4, stride 2,
/// leaky ReLU) to 32, 32, 16, 16 channels -> convolution of kernel 3, sigmoid: [N,T,C] in (0,1).
class Decoder : public Module {
 public:
  Decoder(const VaeOptions& options, Rng& rng);
  Variable forward(const Variable& z) const;

 private:
  Dim coarse_;  // T / 16
  Linear widen_, unfold_;
  std::vector<ConvTranspose1d> conv_;
  Conv1d out_;
};

}  // namespace supertac
