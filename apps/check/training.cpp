#include "apps/check/training.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/train/ledger_file.h"
#include "apps/train/run_folder.h"
#include "apps/train/training_options.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

// What the model says of its training; "" where it says nothing.
Json provenance_of(const std::string& path) {
  const SafetensorsFile file = SafetensorsFile::read(path);
  const auto found = file.metadata().find(kProvenanceKey);
  if (found == file.metadata().end())
    throw FileError(path, "does not say how it was made; train it with this version to have it checked");
  return parse_json_limited(found->second);
}

void check_recordings(const Arguments& a, const Recipe& recipe, const Json& provenance) {
  const std::string found = hash_of_recordings(a.text("data"), recipe.plates);
  const std::string expected = provenance.at("parents").value("recordings", "");
  if (found != expected)
    throw FileError(a.text("data"),
                    "holds other recordings than the model was trained on: expected content " + expected +
                        ", found " + found);
}

struct Segment {
  std::int64_t from, to;
};

std::vector<Segment> segments_of(const std::string& folder, const Ledger& ledger, std::int64_t total) {
  const std::int64_t apart = LedgerFile::apart(ledger.every, total);
  std::vector<Segment> segments;
  for (std::int64_t from = 0; from < total; from += apart) {
    const std::int64_t to = std::min(from + apart, total);
    if (!std::filesystem::exists(LedgerFile::state_path(folder, from)))
      throw FileError(LedgerFile::state_path(folder, from), "is missing; the ledger says that it was kept");
    segments.push_back({from, to});
  }
  return segments;
}

// Those to be repeated, drawn without looking at them, in their order.
std::vector<Segment> drawn(std::vector<Segment> segments, std::size_t count, std::uint64_t seed) {
  const RandomStream random(seed, stream_of("audit"));
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const auto rest = static_cast<double>(segments.size() - i);
    std::swap(segments[i], segments[i + static_cast<std::size_t>(random.uniform(i) * rest)]);
  }
  segments.resize(std::min(count, segments.size()));
  std::sort(segments.begin(), segments.end(),
            [](const Segment& x, const Segment& y) { return x.from < y.from; });
  return segments;
}

// The first line that comes out otherwise, if any.
std::optional<LedgerDifference> repeat(Trainer& trainer, const Ledger& ledger, const Segment& s,
                                       const std::function<void()>& after_step) {
  const LedgerLine* before = s.from == 0 ? nullptr : ledger.at(s.from);
  LedgerWriter writer(trainer, ledger.every, before);
  while (trainer.step() < s.to) {
    stop_if_interrupted();
    trainer.train_step();
    after_step();
    const std::optional<LedgerLine> mine = writer.after_step();
    if (!mine) continue;
    const LedgerLine* theirs = ledger.at(mine->step);
    if (theirs == nullptr) return LedgerDifference{s.from, mine->step, "a line that is missing", false};
    if (const auto d = difference(ledger, *theirs, *mine)) return d;
  }
  return std::nullopt;
}

// Whether a kept state is what the ledger's line of its step says.
std::optional<LedgerDifference> state_difference(const Trainer& trainer, const Ledger& ledger) {
  const LedgerLine* line = ledger.at(trainer.step());
  if (line == nullptr) return std::nullopt;  // the beginning, which follows from the seed
  LedgerLine mine = *line;
  mine.tensors = hashes_of(trainer);
  return difference(ledger, *line, mine);
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

// The model file has to hold the parameters of the last state.
bool is_of(const std::string& model, const Network& network) {
  const ModelFile file = load_model(model);
  const auto& a = network.parameters();
  const auto& b = file.network().parameters();
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Parameter& x, const Parameter& y) {
    const auto p = std::as_bytes(x.value.value().values()), q = std::as_bytes(y.value.value().values());
    return x.name == y.name && std::equal(p.begin(), p.end(), q.begin(), q.end());
  });
}

}  // namespace

int check_training(const Arguments& a) {
  const std::string model = a.text("FILE"), folder = RunFolder::folder_of(model);
  const Json provenance = provenance_of(model);
  const Recipe recipe = Recipe::of(load_model(model), model);
  const Ledger ledger = Ledger::read(LedgerFile::path_in(folder));
  check_recordings(a, recipe, provenance);
  TrainingTask task = window_task(recipe, folders_of(a));
  Trainer trainer(*task.examples, task.split.train, std::move(task.objective));
  const std::vector<Segment> all = segments_of(folder, ledger, trainer.total_steps());
  const std::vector<Segment> chosen =
      drawn(all, static_cast<std::size_t>(a.integer("segments", 1, 1000)), a.seed());

  Json rows = Json::array();
  std::size_t wrong = 0;
  const auto say = [&](const std::string& what, const std::optional<LedgerDifference>& d, Json row) {
    a.print(what + (d ? text_of(*d) : "the same"));
    if (d) row["difference"] = to_json(*d);
    wrong += d.has_value();
    rows.push_back(std::move(row));
  };
  std::int64_t steps = 0, done = 0;
  for (const Segment& s : chosen) steps += s.to - s.from;
  std::optional<Progress> progress(std::in_place, a, "repeating", static_cast<std::uint64_t>(steps), "steps");
  for (const Segment& s : chosen) {
    trainer.restore(LedgerFile::state_path(folder, s.from), task.origin);
    auto d = state_difference(trainer, ledger);
    if (!d) d = repeat(trainer, ledger, s, [&] { progress->update(static_cast<std::uint64_t>(++done)); });
    say("steps " + std::to_string(s.from) + " to " + std::to_string(s.to) + ": ", d,
        {{"from", s.from}, {"to", s.to}});
  }
  progress.reset();
  trainer.restore(LedgerFile::state_path(folder, trainer.total_steps()), task.origin);
  auto last = state_difference(trainer, ledger);
  if (!last && !is_of(model, trainer.model()))
    last = LedgerDifference{trainer.step(), trainer.step(), "the model's file", false};
  say("the model against the last state: ", last, {{"model", model}});
  a.print(std::to_string(chosen.size()) + " of " + std::to_string(all.size()) + " segments repeated, " +
          std::to_string(wrong) + " differences");
  a.write_json(
      {{"segments", all.size()}, {"repeated", chosen.size()}, {"differences", wrong}, {"rows", rows}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

int check_ledgers(const Arguments& a) {
  const Ledger one = Ledger::read(a.text("FILE")), two = Ledger::read(a.text("OTHER"));
  const auto d = first_difference(one, two);
  const std::size_t both = std::min(one.lines.size(), two.lines.size());
  a.print(d ? text_of(*d)
            : "the same in " + std::to_string(both) + " lines" +
                  (one.lines.size() != two.lines.size() ? ", behind which one of them ends" : ""));
  a.write_json({{"lines", both}, {"difference", d ? to_json(*d) : Json()}});
  return d ? kExitFailed : kExitOk;
}

}  // namespace supertac
