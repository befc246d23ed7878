// SuperTac (Front. Robot. AI 12:1552922, 2025): VAEs over groups of taxels, residual upsampling of their
// latents; of single frames (T = 1) residual upsampling alone.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "autograd/kernels/fast/pool.h"
#include "autograd/trace.h"
#include "layers/residual.h"
#include "models/networks/vae.h"

namespace supertac {

/// Which taxels one VAE sees. Taxel k lies in column k % columns (x) and row k / columns (y) of the array.
enum class Grouping {
  horizontal,  ///< the rows: of a 4x4 array group i = taxels 4i .. 4i+3
  vertical,    ///< the columns: of a 4x4 array group i = taxels i, i+4, i+8, i+12
};
/// From and to "horizontal" and "vertical"; throws std::invalid_argument for another name.
Grouping grouping_of(const std::string& name);
std::string name_of(Grouping grouping);

constexpr Dim kMostLines = 64;

struct SuperTacSettings {
  std::string preset = "paper";
  Dim rows = 4, columns = 4;  ///< of the array: 1 to kMostLines
  Dim in_channels = 1;        ///< numbers a taxel gives: 1 to 8
  Dim timesteps = 256;  ///< T: 32 to 512, a multiple of 16; or 1, single frames, for which there are no VAEs
  Dim latent = 10;      ///< LD: 1 to 256; of no meaning for single frames
  Dim scale = 4;        ///< 2, 4, 8, 16: pictures so many times finer than the array, 3 to 1024 pixels a side
  Grouping grouping = Grouping::horizontal;
  Dim channels = 32;  ///< of the upsampler: 4 to 256
  Dim rcabs = 3;      ///< in each RIRB: 0 to 16
  /// Whether the upsampler also sees the last frame itself. With few latents, or fast sensors, those of a
  /// window lose what the array feels now.
  bool last_frame_path = false;
  bool predicted_error = false;  ///< whether it also draws how far off each pixel may be; presets do
  /// Whether the upsampler sees the last frame: of single frames there is nothing else to see.
  bool sees_last_frame() const { return last_frame_path || timesteps == 1; }

  Dim signals() const { return rows * columns * in_channels; }  ///< numbers in a frame
  /// VAEs: one for each group of taxels.
  Dim groups() const { return timesteps == 1 ? 0 : grouping == Grouping::horizontal ? rows : columns; }
  Dim latents() const { return groups() * latent; }           ///< of all groups
  Dim group_signals() const { return signals() / groups(); }  ///< not of single frames, which have no group
  Dim image_height() const { return rows * scale; }
  Dim image_width() const { return columns * scale; }
  /// Throws std::invalid_argument naming the setting, its range and what was given.
  void check() const;
  /// The network of a named recipe (models/training/recipe.h): "paper"; "tiny" has a ninth of its
  /// multiply-adds, "frame" its upsampler alone. Throws std::invalid_argument for an unknown name, listing
  /// the known ones.
  static SuperTacSettings of_preset(const std::string& name);
};

/// What a network is for: inputs of `frames` frames of rows x columns taxels with `channels` numbers each,
/// and pictures `scale` times finer than the array.
struct NetworkFormat {
  Dim frames = 1, rows = 4, columns = 4, channels = 1, scale = 4;
  bool operator==(const NetworkFormat&) const = default;
};
/// "32 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 16x16", for messages.
std::string text(const NetworkFormat& format);

/// Pictures, with the predicted errors and latents of networks that have them.
struct Estimate {
  Tensor picture;          ///< [N,rows scale,columns scale,1]
  Tensor predicted_error;  ///< the same: how far from the truth a pixel is expected to be; undefined where
                           ///< nothing says so
  Tensor latents;          ///< [N,latents]; undefined for a network without any
};

/// The same on the graph, of the same shapes.
struct Prediction {
  Variable picture, predicted_error, latents;
};

/// One T for each group; a warm step must not go to the heap.
template <class T>
using PerGroup = std::vector<T, PoolAllocator<T>>;

/// Makes picture and predicted error [N,rows scale,columns scale,1], linear outputs, of the latents of the G
/// groups [N,G LD] and, where settings.sees_last_frame(), of the windows' last frame. A linear layer makes a
/// map [N,rows,columns,channels] of the latents, a convolution one of the frame; of both the sum.
class Upsampler : public Module {
 public:
  Upsampler(const SuperTacSettings& settings, Rng& rng);
  /// `windows` [N,T,signals] as the network takes them; latents are undefined where there are none.
  Prediction forward(const Variable& latents, const Variable& windows) const;

 private:
  Variable map_of(const Variable& latents, const Variable& windows) const;

  Dim rows_, columns_, in_channels_;  // the map it starts from, and of the last frame
  std::optional<Linear> fc_;
  std::vector<Rirb> rirbs_;
  std::optional<Conv2d> out_, predicted_error_, last_frame_;
};

/// Takes what WindowSet::window() gives, numbers in [0,1]. Pictures have no bounds; trained on plates they
/// lie about in [-1,1], 0 being the plate's plane.
class SuperTac : public Module {
 public:
  /// Throws as SuperTacSettings::check.
  SuperTac(const SuperTacSettings& settings, Rng& rng);

  struct Output {
    PerGroup<Variable> input;             ///< [N,T,group_signals], the windows of the groups
    PerGroup<LatentDistribution> latent;  ///< [N,LD]
    PerGroup<Variable> decoded;           ///< [N,T,group_signals]
    Variable picture;                     ///< [N,rows scale,columns scale,1]
    Variable predicted_error;             ///< the same, or undefined
  };
  /// Training: windows [N,T,signals] in [0,1] and eps [N,LD] ~ N(0,1) for each group.
  /// Throws std::invalid_argument on other shapes.
  Output forward(const Tensor& windows, std::span<const Tensor> eps) const;
  /// Evaluation: z = mean, no decoders. Throws std::invalid_argument unless windows have the input_shape() of
  /// some count.
  Prediction draw(const Variable& windows) const;
  /// The same without recording. For many pictures use CompiledModel
  /// (models/inference/compiled/compiled_model.h), which is faster.
  Estimate estimate(const Tensor& windows) const;
  /// The pictures alone, [N,rows scale,columns scale,1].
  Tensor infer(const Tensor& windows) const { return estimate(windows).picture; }
  /// The latent means [N,G LD]. Throws std::invalid_argument for single frames, which have none.
  Tensor encode(const Tensor& windows) const;

  const SuperTacSettings& settings() const { return settings_; }
  NetworkFormat format() const;
  /// Of a batch of `count` inputs; likewise picture_shape().
  Shape input_shape(Dim count) const { return {count, settings_.timesteps, settings_.signals()}; }
  Shape picture_shape(Dim count) const {
    return {count, settings_.image_height(), settings_.image_width(), 1};
  }

 private:
  PerGroup<Variable> split(const Variable& windows) const;
  Variable means(const Variable& windows) const;

  SuperTacSettings settings_;
  std::vector<Encoder> encoders_;
  std::vector<Decoder> decoders_;
  Upsampler upsampler_;
};

/// One inference on these inputs, unrecorded, and the ops that it ran. One of a thread at a time, as Trace.
struct TracedPrediction {
  TracedPrediction(const SuperTac& network, const Tensor& inputs)
      : input(inputs), drawn(network.draw(input)) {}

  NoGrad no_grad;
  Trace trace;
  Variable input;
  Prediction drawn;
};

}  // namespace supertac
