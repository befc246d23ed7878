#include "models/networks/cost.h"

namespace supertac {
namespace {

// Of one VAE over `signals`; lengths and channels as in models/networks/vae.cpp.
double encoder_macs(Dim timesteps, Dim signals) {
  const Dim t = timesteps;
  const Dim conv =
      t / 2 * 3 * signals * 16 + t / 4 * 3 * 16 * 32 + t / 8 * 3 * 32 * 32 + t / 16 * 3 * 32 * 32;
  return static_cast<double>(conv + 32 * (t / 16) * 64);
}

double head_macs(Dim latent) { return static_cast<double>(64 * latent); }

double decoder_macs(Dim timesteps, Dim signals, Dim latent) {
  const Dim t = timesteps;
  const Dim linear = latent * 64 + 64 * 32 * (t / 16);
  const Dim conv = t / 16 * 4 * 32 * 32 + t / 8 * 4 * 32 * 32 + t / 4 * 4 * 32 * 16 + t / 2 * 4 * 16 * 16;
  return static_cast<double>(linear + conv + t * 3 * 16 * signals);
}

double upsampler_macs(const SuperTacSettings& s) {
  const Dim c = s.channels;
  Dim pixels = s.rows * s.columns;
  Dim macs = s.latents() * c * pixels + (s.sees_last_frame() ? pixels * 9 * s.in_channels * c : 0);
  for (Dim size = 1; size < s.scale; size *= 2, pixels *= 4) {
    const Dim conv = pixels * 9 * c * c, attention = 2 * c * (c / RirbOptions{}.reduction);
    macs += s.rcabs * (2 * conv + attention) + conv + pixels * 16 * c * c;
  }
  return static_cast<double>(macs + pixels * 9 * c);
}

}  // namespace

Cost cost_of(const SuperTacSettings& s) {
  s.check();
  const double upsampler = upsampler_macs(s), head = head_macs(s.latent);
  if (s.groups() == 0) return {.inference = upsampler, .training = 3 * upsampler};
  const double encoder = encoder_macs(s.timesteps, s.group_signals());
  const double decoder = decoder_macs(s.timesteps, s.group_signals(), s.latent);
  const auto groups = static_cast<double>(s.groups());
  const double forward = groups * (encoder + 2 * head + decoder) + upsampler;
  return {.inference = groups * (encoder + head) + upsampler, .training = 3 * forward};
}

}  // namespace supertac
