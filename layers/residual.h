// Residual blocks with channel attention (Zhang et al. 2018, RCAN) and the upsampling stage of SuperTac.
#pragma once

#include <vector>

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

/// Weighs channels: sigmoid(expand(relu(squeeze(mean over pixels)))), RCAN section 3.3, squeezed to C / 4.
/// x [N,H,W,C] -> [N,C].
class ChannelAttention : public Module {
 public:
  /// Throws std::invalid_argument for fewer than four channels; likewise the blocks below.
  ChannelAttention(Dim channels, Rng& rng);
  /// Each in (0,1): all near 0 or all near 1 means the block has saturated.
  Variable gates(const Variable& x) const;

 private:
  Linear squeeze_, expand_;
};

/// x + h gates(h), h = conv(relu(conv(x))), both convolutions 3x3 (RCAN section 3.4); no batch norm.
/// x [N,H,W,C] -> same.
class Rcab : public Module {
 public:
  Rcab(Dim channels, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  Conv2d first_, second_;
  ChannelAttention attention_;
};

/// Residual in residual, then twice the size: leaky_relu(up(x + conv(rcab(...rcab(x))))).
/// x [N,H,W,C] -> [N,2H,2W,C]; up is a transposed convolution of kernel 4, stride 2, padding 1.
class Rirb : public Module {
 public:
  /// `blocks`: how many RCABs, 0 or more.
  Rirb(Dim channels, Dim blocks, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  std::vector<Rcab> blocks_;
  Conv2d conv_;
  ConvTranspose2d up_;
};

}  // namespace supertac
