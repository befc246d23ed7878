// The task of supertac-classify: which windows a classifier is trained on and asked about, given models that
// have not seen the answers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/training/recipe.h"

namespace supertac {

/// What a classifier is trained on and asked: window indices, and a class for each pass of the data.
struct Exam {
  std::vector<std::uint32_t> train, test;
  std::vector<std::int32_t> label_of_pass;
  std::int32_t classes = 0;
};

/// Which test windows are counted. Near the ends of a texture one element is seen of any plate, and beyond
/// them none: there no picture, not even a perfect one, tells plates apart.
enum class Part {
  inside,   ///< the whole picture lies on the texture
  contact,  ///< the truth has a pixel above 0
  all,
};
inline constexpr const char* kParts[] = {"inside", "contact", "all"};

/// A model, and what it was trained with.
struct Candidate {
  std::string path;
  Recipe recipe;
  ModelFile file;
};

/// Throws std::runtime_error naming the file: when it cannot be read, does not say how it was trained, was
/// trained on all windows, or differs from the first in more than its seeds.
std::vector<Candidate> load_candidates(const std::vector<std::string>& paths);

/// The recordings' windows as the models take them. No plates: those of the first model.
WindowSet exam_windows(const std::string& folder, std::vector<std::string> plates, const Candidate& first);

/// The plates of a data set in the order of their first pass; a plate's place is its class.
/// Throws std::runtime_error when there is only one.
std::vector<std::string> classes_of(const WindowSet& windows);

/// Both sides of the split that the model was trained with, so that neither model nor classifier has seen
/// the tested windows; trained on is every stride-th window in contact. Throws std::runtime_error when that
/// split cannot be repeated on these windows.
Exam make_exam(const WindowSet& windows, const Candidate& model, const std::vector<std::string>& classes,
               std::int64_t stride);

/// The narrowest part that each test window belongs to; without positions all in contact are inside.
std::vector<Part> parts_of(const WindowSet& windows, const Exam& exam);

}  // namespace supertac
