// The options of supertac-train: what they change in a recipe (models/training/recipe.h), and its folder.
#pragma once

#include "apps/common/command_line/arguments.h"
#include "data/recordings/resample.h"
#include "models/training/recipe.h"

namespace supertac {

/// Split, steps, network, windows, augmentation and loss: all but the recordings and the seed.
void declare_training(Arguments& a);
/// The recipe of --preset or of the model --recipe-of, with all options over it, --seed included. Throws
/// UsageError, and as load_model() and Recipe::of().
Recipe recipe_of(const Arguments& a);

/// Of a model file: "model.safetensors" -> "model.run".
std::string run_folder_of(const std::string& model_file);

/// Shows how far the reading of --data is.
ReadingWatch reading_progress(const Arguments& a);

}  // namespace supertac
