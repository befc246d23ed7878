#include "apps/classify/exam.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "data/windows/split.h"

namespace supertac {
std::vector<Candidate> load_candidates(const std::vector<std::string>& paths) {
  std::vector<Candidate> all;
  for (const std::string& path : paths) {
    ModelFile file = load_model(path);
    const Recipe recipe = Recipe::of(file, path);
    all.push_back({path, recipe, std::move(file)});
    const Candidate &first = all.front(), &last = all.back();
    if (recipe.split == SplitKind::none) {
      throw std::runtime_error(path + ": was trained on all windows (split none), so none is left to test");
    }
    for (const char* key : {"input", "settings", "split", "stride"}) {
      const std::string ours = value_or(last.file.metadata, key), theirs = value_or(first.file.metadata, key);
      if (ours != theirs) {
        throw std::runtime_error(path + ": its " + key + " is " + ours + ", that of " + first.path + " is " +
                                 theirs + "; give models that differ in their seeds only");
      }
    }
  }
  return all;
}

WindowSet exam_windows(const std::string& folder, std::vector<std::string> plates, const Candidate& first) {
  WindowSettings w = first.file.windows();
  w.stride = static_cast<int>(first.recipe.stride);
  if (plates.empty()) plates = first.recipe.plates;
  return WindowSet::load(folder, plates, w);
}

std::vector<std::string> classes_of(const WindowSet& windows) {
  std::vector<std::string> names;
  for (const WindowSet::Pass& pass : windows.passes()) {
    if (std::find(names.begin(), names.end(), pass.plate) == names.end()) names.push_back(pass.plate);
  }
  if (names.size() < 2)
    throw std::runtime_error("the recordings are of one plate; there is nothing to tell apart");
  return names;
}

Exam make_exam(const WindowSet& windows, const Candidate& model, const std::vector<std::string>& classes,
               std::int64_t stride) {
  const SplitKind kind = model.recipe.split;
  Split split = make_split(windows, kind, model.recipe.seed);
  // Trials are what they are; other splits are drawn from the windows there are.
  if (kind != SplitKind::trial && fingerprint(split) != value_or(model.file.metadata, "split_fingerprint")) {
    throw std::runtime_error(model.path +
                             ": its split cannot be repeated on this data, and it may have seen the test "
                             "windows; give the recordings and plates it was trained on");
  }
  Exam exam;
  exam.classes = static_cast<std::int32_t>(classes.size());
  for (const WindowSet::Pass& pass : windows.passes()) {
    const auto at = std::find(classes.begin(), classes.end(), pass.plate);
    exam.label_of_pass.push_back(static_cast<std::int32_t>(at - classes.begin()));
  }
  std::int64_t number = 0;
  for (const std::uint32_t i : split.train) {
    if (windows.contact(i) && number++ % stride == 0) exam.train.push_back(i);
  }
  if (exam.train.empty()) throw std::runtime_error("no training window is in contact with its plate");
  exam.test = std::move(split.test);
  return exam;
}

std::vector<Part> parts_of(const WindowSet& windows, const Exam& exam) {
  std::vector<Part> parts;
  for (const std::uint32_t i : exam.test) {
    const Plate& plate = windows.plate(windows.pass_of(i));
    const double y = windows.position(i).y_mm;
    const double half = windows.image().height_mm() / 2;
    const bool contact = windows.contact(i);
    const bool inside =
        std::isnan(y) ? contact : y - half >= plate.texture_begin() && y + half <= plate.texture_end();
    parts.push_back(inside ? Part::inside : contact ? Part::contact : Part::all);
  }
  return parts;
}

}  // namespace supertac
