// The options that programs which train have in common, and what they mean.
#pragma once

#include "apps/common/command_line/arguments.h"
#include "data/windows/split.h"
#include "models/training/objective.h"

namespace supertac {

/// Split, steps and loss: what every training has.
void declare_training(Arguments& a);
/// Recordings, windows, augmentation and the loss of SuperTac: everything else but the network and the seed.
void declare_window_training(Arguments& a);

/// The network of one training, and declare_window_training(): what stands beside --data only.
void declare_network(Arguments& a);
/// What these say, --seed included. Throws UsageError.
TrainingSettings network_settings(const Arguments& a);

/// What the options of declare_training() say. Throws UsageError.
void read_pace(const Arguments& a, TrainingPace& pace);

/// What these options say about training this network; where they are not given, what its preset is best
/// trained with. --grouping is set in the network; the seed is left to the caller. Throws UsageError.
TrainingSettings training_settings(const Arguments& a, const SuperTacSettings& model);

/// --rate, or the preset's. Throws UsageError.
double training_rate_hz(const Arguments& a, const SuperTacSettings& model);

/// --split. Throws UsageError.
SplitKind training_split(const Arguments& a);

/// The recordings' windows as this network takes them, and those of --random-plates, drawn with `seed`.
/// Throws as WindowSet::load.
WindowSet training_windows(const Arguments& a, const SuperTacSettings& model, std::uint64_t seed);

}  // namespace supertac
