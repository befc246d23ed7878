#include "apps/classify/exam.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "data/windows/split.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

std::string metadata_of(const ModelFile& file, const std::string& path, const std::string& key) {
  const auto found = file.metadata.find(key);
  if (found != file.metadata.end()) return found->second;
  throw std::runtime_error(
      path + ": metadata \"" + key +
      "\" is missing, so it is unknown what the model was trained on; train it anew with "
      "supertac-train");
}

std::int64_t number_of(const ModelFile& file, const std::string& path, const std::string& key) {
  const std::string text = metadata_of(file, path, key);
  if (const auto number = parse_int(text); number && *number >= 0) return *number;
  throw std::runtime_error(path + ": metadata \"" + key + "\" must be a whole number, found " + text);
}

}  // namespace

std::vector<Candidate> load_candidates(const std::vector<std::string>& paths) {
  std::vector<Candidate> all;
  for (const std::string& path : paths) {
    ModelFile file = load_model(path);
    const std::string split = metadata_of(file, path, "split");
    const auto seed = static_cast<std::uint64_t>(number_of(file, path, "seed"));
    all.push_back({path, split, seed, std::move(file)});
    const Candidate &first = all.front(), &last = all.back();
    if (split_kind(split) == SplitKind::none) {
      throw std::runtime_error(path + ": was trained on all windows (split none), so none is left to test");
    }
    for (const char* key : {"input", "settings", "split", "stride"}) {
      const std::string ours = metadata_of(last.file, path, key),
                        theirs = metadata_of(first.file, first.path, key);
      if (ours != theirs) {
        throw std::runtime_error(path + ": its " + key + " is " + ours + ", that of " + first.path + " is " +
                                 theirs + "; give models that differ in their seeds only");
      }
    }
  }
  return all;
}

WindowSet exam_windows(const std::string& folder, std::vector<std::string> plates, const Candidate& first) {
  const ModelFile& file = first.file;
  WindowSettings w = file.windows();
  w.stride = static_cast<int>(number_of(file, first.path, "stride"));
  if (plates.empty()) plates = comma_list(metadata_of(file, first.path, "plates"));
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
  const SplitKind kind = split_kind(model.split);
  Split split = make_split(windows, kind, model.seed);
  // Trials are what they are; other splits are drawn from the windows there are.
  if (kind != SplitKind::trial &&
      fingerprint(split) != metadata_of(model.file, model.path, "split_fingerprint")) {
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
