// SuperTac (Front. Robot. AI 12:1552922, 2025): four VAEs over groups of taxels, residual upsampling of their
// latents.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "layers/residual.h"
#include "models/vae.h"

namespace supertac {

inline constexpr Dim kGroups = 4;
inline constexpr Dim kGroupTaxels = 4;
inline constexpr Dim kWindowTaxels = kGroups * kGroupTaxels;

/// Which four taxels one VAE sees. Taxel k lies in column k % 4 (x) and row k / 4 (y) of the array.
enum class Grouping {
  horizontal,  ///< the rows: group i = taxels 4i .. 4i+3
  vertical,    ///< the columns: group i = taxels i, i+4, i+8, i+12
};
/// Both throw std::invalid_argument / return "horizontal" or "vertical".
Grouping grouping_of(const std::string& name);
std::string name_of(Grouping grouping);

struct SuperTacSettings {
  std::string preset = "paper";
  Dim timesteps = 256;  ///< T: 32 to 512, a multiple of 16
  Dim latent = 10;      ///< LD: 1 to 256
  Dim scale = 4;        ///< 2, 4, 8: pictures of 8, 16, 32 pixels a side
  Grouping grouping = Grouping::horizontal;
  Dim channels = 32;       ///< of the upsampler
  Dim rcabs = 3;           ///< in each RIRB
  bool sub_pixel = false;  ///< RIRBs enlarge by sub-pixel instead of transposed convolution

  Dim image_size() const { return 4 * scale; }
  /// Throws std::invalid_argument naming the setting, its range and what was given.
  void check() const;
  /// A preset's settings: "paper", or "tiny", which costs a ninth. Both were made for windows of 2.56 s.
  /// Throws std::invalid_argument for an unknown name, listing the known ones.
  static SuperTacSettings of_preset(const std::string& name);
};

/// Samples a second that a preset was made for. Throws as SuperTacSettings::of_preset.
double rate_of_preset(const std::string& name);

/// Latents of the four groups [N,4 LD] -> picture [N,S,S,1], linear output.
class Upsampler : public Module {
 public:
  Upsampler(const SuperTacSettings& settings, Rng& rng);
  Variable forward(const Variable& latents) const;

 private:
  Linear fc_;
  std::vector<Rirb> rirbs_;
  Conv2d out_;
};

class SuperTac : public Module {
 public:
  /// Throws as SuperTacSettings::check.
  SuperTac(const SuperTacSettings& settings, Rng& rng);

  struct Output {
    std::array<Variable, kGroups> input;             ///< [N,T,4], the windows of the groups
    std::array<LatentDistribution, kGroups> latent;  ///< [N,LD]
    std::array<Variable, kGroups> decoded;           ///< [N,T,4]
    Variable image;                                  ///< [N,S,S,1]
  };
  /// Training: windows [N,T,16] in [0,1] and eps [N,LD] ~ N(0,1) for each group.
  /// Throws std::invalid_argument on other shapes.
  Output forward(const Tensor& windows, const std::array<Tensor, kGroups>& eps) const;
  /// Evaluation: z = mean, no decoders, nothing recorded. windows [N,T,16] -> [N,S,S,1].
  Tensor infer(const Tensor& windows) const;
  /// The latent means [N,4 LD].
  Tensor encode(const Tensor& windows) const;

  const SuperTacSettings& settings() const { return settings_; }

 private:
  std::array<Variable, kGroups> split(const Tensor& windows) const;

  SuperTacSettings settings_;
  std::vector<Encoder> encoders_;
  std::vector<Decoder> decoders_;
  Upsampler upsampler_;
};

}  // namespace supertac
