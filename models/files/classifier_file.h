// A texture classifier on disk, with the names of its classes.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/files/file.h"
#include "models/networks/classifier.h"

namespace supertac {

struct NamedClassifier {
  std::vector<std::string> names;  ///< of the classes
  ClassifierSettings settings;
  std::unique_ptr<TextureClassifier> network;

  struct Answer {
    std::string name;
    double probability = 0;
  };
  /// The most probable class of a picture [height][width], and its softmax probability. Throws
  /// std::invalid_argument for a picture of another size.
  Answer name_of(std::span<const float> picture) const;
};

/// Writes a classifier of super-resolved pictures. Throws FileError.
void save_classifier(const OutputPath& output, const TextureClassifier& network,
                     const ClassifierSettings& settings, const std::vector<std::string>& names);
/// Throws std::runtime_error naming path, what was expected and found.
NamedClassifier load_classifier(const std::string& path);

}  // namespace supertac
