// The options of programs that train: what they change in a recipe (models/training/recipe.h).
#pragma once

#include "apps/common/command_line/arguments.h"
#include "models/training/task.h"

namespace supertac {

/// Split, steps and loss: what every training has.
void declare_training(Arguments& a);
/// Recordings, windows, augmentation and the loss of SuperTac: everything else but the network and the seed.
void declare_window_training(Arguments& a);
/// --preset and --like, the network of one training, and declare_window_training().
void declare_network(Arguments& a);

/// `base` with what the options of declare_training() and declare_window_training() change. Throws
/// UsageError.
Recipe recipe_of(const Arguments& a, Recipe base);
/// The recipe of --preset or of the model --like, with all options over it, --seed included. Throws
/// UsageError, and as load_model() and Recipe::of().
Recipe recipe_of(const Arguments& a);

/// --data, read with a progress bar.
RecordingFolders folders_of(const Arguments& a);

}  // namespace supertac
