// Everything that decides a trained file besides the recordings and the order of their file names: the same
// recipe and the same recordings make the same bytes, whoever trains (docs/determinism.md).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "data/windows/split.h"
#include "data/windows/transforms.h"
#include "models/inference/interval.h"
#include "models/networks/supertac_model.h"
#include "models/training/loss/loss.h"

namespace supertac {

struct ModelFile;

struct Recipe {
  std::int64_t epochs = 20;  ///< 1 to 100,000
  std::int64_t batch = 64;   ///< 1 to 4096
  std::uint64_t seed = 0;
  double learning_rate = 1e-3;  ///< Adam's peak, above 0 and at most 1
  double warm_up = 0.05;        ///< share of all steps in which the rate rises; then half a cosine to 0
  double clip_norm = 1;         ///< 0 = never
  bool muon = false;            ///< as AdamOptions::muon
  SuperTacSettings model;       ///< rows, columns and in_channels become those of the recordings
  LossWeights loss;
  /// Whether z is drawn around its mean. Without, and with beta 0, the VAEs are plain autoencoders: older
  /// files have it (preset "best").
  bool sampling = true;
  /// Of the windows. With any of it, passes in which nothing is felt are added (add_silent_passes).
  AugmentSettings augment;

  std::vector<std::string> plates;     ///< only recordings of these; none: of all
  SplitKind split = SplitKind::trial;  ///< what is kept for testing
  std::vector<std::string>
      leave_out;  ///< of split texture the plates that are tested, of split group the groups
  /// With split group, and three groups or more to train on: one of them is held out, and the network of the
  /// epoch that draws it best is kept. Training ends when five epochs have brought no better one.
  bool keeps_best = false;
  double rate_hz = 300;            ///< of the model's samples, 20 to 2000
  double delay_s = 0;              ///< of pictures: as WindowSettings, less than the window
  std::int64_t stride = 1;         ///< every stride-th frame of a pass ends a window
  std::optional<Scaling> range;    ///< rest and span; empty: SignalRange::fitted()
  bool per_window = true;          ///< whether a window is brought to its own rest and gain
  std::int64_t random_plates = 0;  ///< simulated passes besides, each over a plate of its own
  /// What the model's file says of its intervals; empty: what split group finds on the tested groups, on
  /// other splits the default.
  std::optional<PixelInterval> interval_factor;

  /// Throws std::invalid_argument naming the setting, its range and what was given.
  void check() const;

  /// `paper`: as in the paper, at 100 Hz. `tiny`: a ninth of the multiply-adds, at 50 Hz. Epochs and learning
  /// rate are those that measured best on the rig's recordings (bench/results). `frame`: single frames as
  /// they are, of sensors that press or lie still. Throws std::invalid_argument for another name, listing
  /// these.
  static Recipe named(const std::string& name);
  /// What `file` was trained with, its signal range included: the same recordings give the same file again.
  /// Throws std::runtime_error naming path and entry when the file does not say it.
  static Recipe of(const ModelFile& file);
};

/// What a model file says of its recipe besides the entries "settings" and "input" of model_metadata().
/// Newer settings at their defaults are left out, so that older files keep their text.
std::map<std::string, std::string> metadata_of(const Recipe& recipe);

/// The entry "training" of a model file: steps, loss and augmentation as JSON text.
std::string training_text(const Recipe& recipe);

}  // namespace supertac
