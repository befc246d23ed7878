#include "apps/check/repetition.h"

#include <algorithm>
#include <filesystem>

#include "apps/common/running/signals.h"
#include "apps/train/run_folder.h"
#include "apps/train/training_options.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "models/files/model_file.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

void check_recordings(const Arguments& a, const Recipe& recipe, const std::string& path) {
  const SafetensorsFile file = SafetensorsFile::read(path);
  const auto provenance = file.metadata().find(kProvenanceKey);
  if (provenance == file.metadata().end())
    throw FileError(path, "does not say how it was made; train it with this version to have it checked");
  const std::string found = hash_of_recordings(a.text("data"), recipe.plates);
  const std::string expected = parse_json_limited(provenance->second).at("parents").value("recordings", "");
  if (found != expected)
    throw FileError(a.text("data"), "holds other recordings than " + path +
                                        " was trained on: expected content " + expected + ", found " + found);
}

TrainingTask task_of(const Arguments& a, const std::string& path) {
  const Recipe recipe = Recipe::of(load_model(path), path);
  check_recordings(a, recipe, path);
  return window_task(recipe, folders_of(a));
}

}  // namespace

Repetition::Repetition(const Arguments& a, const std::string& model)
    : folder_(RunFolder::folder_of(model)),
      ledger_(Ledger::read(LedgerFile::path_in(folder_))),
      task_(task_of(a, model)) {
  trainer_.emplace(*task_.windows, task_.split.train, std::move(task_.objective));
}

std::vector<Repetition::Segment> Repetition::segments() const {
  const std::int64_t total = trainer_->total_steps(), apart = LedgerFile::apart(ledger_.every, total);
  std::vector<Segment> segments;
  for (std::int64_t from = 0; from < total; from += apart) {
    if (!std::filesystem::exists(LedgerFile::state_path(folder_, from)))
      throw FileError(LedgerFile::state_path(folder_, from), "is missing; the ledger says that it was kept");
    segments.push_back({from, std::min(from + apart, total)});
  }
  return segments;
}

std::optional<LedgerDifference> Repetition::start(std::int64_t step) {
  const std::int64_t total = trainer_->total_steps(), apart = LedgerFile::apart(ledger_.every, total);
  const std::int64_t kept = step == total ? total : step / apart * apart;
  trainer_->restore(LedgerFile::state_path(folder_, kept), task_.origin);
  const std::optional<LedgerLine> line = ledger_.at(kept);
  writer_.emplace(*trainer_, ledger_.every, line ? &*line : nullptr);
  line_.reset();
  if (!line) return std::nullopt;  // the beginning, which follows from the seed
  LedgerLine mine = *line;
  mine.tensors = hashes_of(*trainer_);
  return difference(ledger_, *line, mine);
}

std::optional<LedgerDifference> Repetition::make_step(const std::function<void()>& make) {
  stop_if_interrupted();
  const std::int64_t before = trainer_->step();
  if (make) {
    make();
  } else {
    trainer_->train_step();
  }
  line_ = writer_->after_step();
  if (!line_) return std::nullopt;
  const std::optional<LedgerLine> theirs = ledger_.at(line_->step);
  if (!theirs) return LedgerDifference{before, line_->step, "a line that is missing", false};
  return difference(ledger_, *theirs, *line_);
}

std::string text_of(const LedgerDifference& d) {
  const std::string where =
      d.step - d.after > 1 ? "between steps " + std::to_string(d.after + 1) + " and " + std::to_string(d.step)
                           : "at step " + std::to_string(d.step);
  return "differs " + where + ": " + d.what +
         (d.batches && d.what != "the batches" ? ", and the batches" : "");
}

Json to_json(const LedgerDifference& d) {
  return {{"after", d.after}, {"step", d.step}, {"tensor", d.what}, {"batches", d.batches}};
}

}  // namespace supertac
