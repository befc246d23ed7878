// A SuperTac model on disk: its parameters, and in the metadata everything needed to run a window through it.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "data/samples/windows.h"
#include "layers/checkpoint.h"
#include "models/supertac_model.h"

namespace supertac {

/// What stands between the sensor and the network's input.
struct InputSettings {
  double rate_hz = 300;
  Scaling scaling;
  /// Length of the moving average (s) that the training signals went through, 0 = none; nothing when they
  /// differed.
  std::optional<double> filter_s = 0.0;
  double pitch_mm = 3;  ///< of the array
};

/// The metadata keys "settings" and "input", JSON texts.
std::map<std::string, std::string> model_metadata(const SuperTacSettings& settings,
                                                  const InputSettings& input);

struct ModelFile {
  std::unique_ptr<SuperTac> model;
  InputSettings input;
  std::map<std::string, std::string> metadata;

  /// The sensor it was trained on.
  TaxelArray array() const;
  /// The windows it takes: its array and length, picture size, rate and scaling.
  WindowSettings windows() const;
};

/// What the windows of a model trained on these have gone through.
InputSettings input_of(const WindowSet& windows);

/// The settings of a model for another array than the default one.
void set_array(SuperTacSettings& settings, const TaxelArray& array);

/// Builds the model that the metadata describes, after checking every setting's range, and fills it.
/// Throws std::runtime_error naming path, what was expected and found.
ModelFile load_model(const std::string& path);
/// The same from a file already read.
ModelFile load_model(const SafetensorsFile& file, const std::string& path);

/// Writes parameters and metadata. Throws FileError.
void save_model(const std::string& path, const SuperTac& model, const InputSettings& input,
                std::map<std::string, std::string> metadata);

}  // namespace supertac
