// Residual blocks with channel attention (Zhang et al. 2018, RCAN) and the upsampling stage of SuperTac.
#pragma once

#include <vector>

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

/// Weighs channels: sigmoid(expand(relu(squeeze(mean over pixels)))), RCAN section 3.3. x [N,H,W,C] -> [N,C].
class ChannelAttention : public Module {
 public:
  /// Throws std::invalid_argument unless 1 <= reduction <= channels.
  ChannelAttention(Dim channels, Dim reduction, Rng& rng);
  /// Each in (0,1): all near 0 or all near 1 means the block has saturated.
  Variable gates(const Variable& x) const;

 private:
  Linear squeeze_, expand_;
};

/// x + h gates(h), h = conv(relu(conv(x))), both convolutions 3x3 (RCAN section 3.4); no batch norm.
/// x [N,H,W,C] -> same.
class Rcab : public Module {
 public:
  /// Throws as ChannelAttention.
  Rcab(Dim channels, Dim reduction, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  Conv2d first_, second_;
  ChannelAttention attention_;
};

struct RirbOptions {
  Dim channels = 32;
  Dim reduction = 4;  ///< channel attention squeezes to channels / reduction
  Dim blocks = 3;     ///< RCABs
};

/// Residual in residual, then twice the size: leaky_relu(up(x + conv(rcab(...rcab(x))))).
/// x [N,H,W,C] -> [N,2H,2W,C]; up is a transposed convolution of kernel 4, stride 2, padding 1.
class Rirb : public Module {
 public:
  /// Throws as ChannelAttention.
  Rirb(const RirbOptions& options, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  std::vector<Rcab> blocks_;
  Conv2d conv_;
  ConvTranspose2d up_;
};

}  // namespace supertac
