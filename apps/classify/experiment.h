// Which plate is under the finger? A classifier is trained on what one view shows of the training windows of
// models that have not seen the answers, and asked about the test windows.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/training/recipe.h"

namespace supertac {

/// What a classifier is shown of a window: the last frame as the network sees it, the means of the latent
/// distributions, or the network's picture.
enum class View { frame, latents, super_resolved };
inline constexpr const char* kViews[] = {"frame", "latents", "super_resolved"};

/// A model, and what it was trained with.
struct Candidate {
  std::string path;
  Recipe recipe;
  ModelFile file;
};

/// Throws std::runtime_error naming the file: when it cannot be read, does not say how it was trained, was
/// trained on all windows, or differs from the first in more than its seeds.
std::vector<Candidate> load_candidates(const std::vector<std::string>& paths);

/// What a classifier is trained on and asked: window indices, and a class for each pass of the data.
struct Dataset {
  std::vector<std::uint32_t> train, test;
  std::vector<std::int32_t> label_of_pass;
};

/// The plates of the windows in the order of their first pass; a plate's place is its class. Throws
/// std::runtime_error when there is only one.
std::vector<std::string> classes_of(const WindowSet& windows);

/// Both sides of the split that the model was trained with, so that neither model nor classifier has seen
/// the tested windows; trained on is every stride-th window in contact. Throws std::runtime_error when that
/// split cannot be repeated on these windows.
Dataset make_dataset(const WindowSet& windows, const Candidate& model,
                     const std::vector<std::string>& classes, std::int64_t stride);

struct ExperimentSettings {
  View view = View::frame;
  std::int64_t epochs = 8;
  std::uint64_t seed = 0;
  OutputPath keep = "";  ///< file for the classifier of pictures; empty: none
};

/// Trains a classifier and returns its answer to every test window, in order. Training windows are augmented
/// as the model's were. The same arguments give the same answers. Throws std::runtime_error when the loss is
/// not finite, FileError.
std::vector<std::int32_t> answers(const Candidate& model, const WindowSet& windows, const Dataset& data,
                                  const std::vector<std::string>& classes,
                                  const ExperimentSettings& settings);

}  // namespace supertac
