// One classifier: trained on one view of the training windows, asked about the test windows.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/classify/exam.h"
#include "apps/classify/views.h"
#include "data/windows/transforms/augment.h"
#include "io/files/file.h"

namespace supertac {

struct ExperimentSettings {
  AugmentSettings augment;  ///< of the windows before they are shown, in training only
  std::int64_t epochs = 8;
  std::int64_t batch = 64;
  double learning_rate = 1e-3;  ///< Adam's, after a warm-up of 5 % and down half a cosine
  std::uint64_t seed = 0;
  OutputPath keep = "";  ///< file for the classifier of pictures; empty: none
};

/// Trains a classifier on the view and returns its answer to every test window, in order. `classes` are the
/// names of the classes. The same arguments give the same answers. Throws std::runtime_error when the loss is
/// not finite, FileError.
std::vector<std::int32_t> answers(const View& view, const SuperTac& model, const WindowSet& data,
                                  const Exam& exam, const std::vector<std::string>& classes,
                                  const ExperimentSettings& settings);

}  // namespace supertac
