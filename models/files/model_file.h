// A model on disk: its parameters, and in the metadata everything needed to run a window through it.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/windows/windows.h"
#include "layers/checkpoint.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/inference/interval.h"
#include "models/inference/novelty.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// How a sensor's signals become the input of SuperTac.
struct InputSettings {
  double rate_hz = 300;
  Scaling scaling = {};
  /// Length of the moving average (s) that the training signals went through, 0 = none; empty when they
  /// differed.
  std::optional<double> filter_s = 0.0;
  /// The moving average (s) that signals still need, to be like those of the training, after one of `done_s`;
  /// empty when that was another one.
  std::optional<double> filter_left(double done_s) const;
  Pitch pitch_mm = 3;             ///< of the array
  SignalScale signal_scale = {};  ///< as the recordings state it: unit, polarity and range of the signals
  double delay_s = 0;             ///< of pictures: as WindowSettings
};

/// The metadata keys "settings" and "input", JSON texts.
std::map<std::string, std::string> model_metadata(const SuperTacSettings& settings,
                                                  const InputSettings& input);

struct ModelFile {
  std::string path = {};  ///< that it was read from
  std::unique_ptr<SuperTac> model;
  InputSettings input;
  std::optional<Novelty> novelty;  ///< of its training windows; empty of too few windows, and of frames of
                                   ///< over 1024 signals and in older files
  std::optional<ActivationRanges> ranges;  ///< empty in older files
  std::map<std::string, std::string> metadata;

  /// What its predicted errors mean: the entry interval_factor, where there is one.
  PixelInterval interval() const;
  /// What int8 needs. Throws std::runtime_error where the file has none.
  const ActivationRanges& int8_ranges() const;
  /// The sensor it was trained on.
  TaxelArray array() const;
  /// The windows it takes: its array and length, picture size, rate and scaling.
  WindowSettings windows() const;
};

/// The input settings of a model that is trained on these windows.
InputSettings input_of(const WindowSet& windows);

/// Sets rows, columns and in_channels to those of the array.
void set_array(SuperTacSettings& settings, const TaxelArray& array);

/// Builds the model that the metadata describes, after checking every setting's range, and fills it.
/// Throws std::runtime_error naming path, what was expected and found.
ModelFile load_model(const std::string& path);
/// The same of a file that has been read.
ModelFile model_of(const SafetensorsFile& file);

/// The models of an ensemble. Throws std::runtime_error, as load_model, and naming the file that differs from
/// the first in what it takes, draws or predicts.
std::vector<ModelFile> load_models(std::span<const std::string> paths);

/// The number format of a network's products.
enum class Precision {
  fp32,
  int8,  ///< bytes, as on a microcontroller: the pictures differ a little
         ///< (models/inference/compiled/compiled_model.h)
};
/// "fp32" or "int8". Throws std::invalid_argument.
Precision precision_of(const std::string& name);
std::string name_of(Precision precision);

/// The model of a file, and the ensemble of several, which must outlive what draws with them. Throw as
/// CompiledModel and Ensemble, and std::runtime_error when a file has no ranges for int8.
CompiledModel compiled(const ModelFile& file, Precision precision);
Ensemble ensemble_of(std::span<const ModelFile> files, Precision precision = Precision::fp32);

/// Parameters and metadata, without ranges and novelty; trainings write by save_trained()
/// (models/training/train.h). Throws FileError.
void save_model(const std::string& path, const SuperTac& model, const InputSettings& input,
                std::map<std::string, std::string> metadata);

}  // namespace supertac
