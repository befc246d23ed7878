// The options of supertac-train: what they change in a recipe (models/training/recipe.h), and its folders.
#pragma once

#include "apps/common/command_line/arguments.h"
#include "models/training/train.h"

namespace supertac {

/// Split, steps, network, windows, augmentation and loss: all but the recordings and the seed.
void declare_training(Arguments& a);
/// The recipe of --preset or of the model --recipe-of, with all options over it, --seed included. Throws
/// UsageError, and as load_model() and Recipe::of().
Recipe recipe_of(const Arguments& a);

/// Of a model file: "model.safetensors" -> "model.run".
std::string run_folder_of(const std::string& model_file);

/// --data, read with a progress bar.
RecordingFolders folders_of(const Arguments& a);

}  // namespace supertac
