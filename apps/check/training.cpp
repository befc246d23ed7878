// A training with a ledger, made again from the states that it kept: pieces of it, or one step, opened.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <optional>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/train/training_options.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/random.h"
#include "models/files/model_file.h"
#include "models/training/audit/ledger.h"
#include "models/training/audit/opened_step.h"
#include "models/training/train.h"

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
  const Recipe recipe = Recipe::of(load_model(path));
  check_recordings(a, recipe, path);
  return window_task(recipe, a.text("data"), reading_progress(a));
}

/// A training with a ledger, made again from the states that it kept.
class Repetition {
 public:
  /// Of the model's run folder, as its file says that it was trained. Throws FileError when that does not say
  /// it, when there is no ledger, or when --data holds other recordings.
  Repetition(const Arguments& a, const std::string& model)
      : folder_(run_folder_of(model)),
        ledger_(Ledger::read(LedgerFile::path_in(folder_))),
        task_(task_of(a, model)),
        trainer_(*task_.windows, task_.split.train, task_.recipe),
        end_(task_.recipe.keeps_best && !ledger_.lines.empty() ? ledger_.lines.back().step
                                                               : trainer_.total_steps()) {}

  /// The training's last step: where it kept the best epoch, it may have ended early.
  std::int64_t end() const { return end_; }

  struct Segment {
    std::int64_t from, to;
  };
  /// From kept state to kept state. Throws FileError when one is missing.
  std::vector<Segment> segments() const {
    const std::int64_t apart = LedgerFile::apart(ledger_.every, trainer_.total_steps());
    std::vector<Segment> segments;
    for (std::int64_t from = 0; from < end_; from += apart) {
      if (!std::filesystem::exists(LedgerFile::state_path(folder_, from)))
        throw FileError(LedgerFile::state_path(folder_, from),
                        "is missing; the ledger says that it was kept");
      segments.push_back({from, std::min(from + apart, end_)});
    }
    return segments;
  }

  /// Goes to the last kept state at or before `step`; what it returns is how the state differs from its line.
  std::optional<LedgerDifference> start(std::int64_t step) {
    const std::int64_t apart = LedgerFile::apart(ledger_.every, trainer_.total_steps());
    const std::int64_t kept = step == end_ ? end_ : step / apart * apart;
    trainer_.restore(LedgerFile::state_path(folder_, kept), task_.origin);
    const std::optional<LedgerLine> line = ledger_.at(kept);
    writer_.emplace(trainer_, ledger_.every, line ? &*line : nullptr);
    line_.reset();
    if (!line) return std::nullopt;  // the beginning, which follows from the seed
    LedgerLine mine = *line;
    mine.tensors = hashes_of(trainer_);
    return difference(ledger_, *line, mine);
  }

  /// Makes a step, by `make` where it is given, and compares with the ledger where that has a line.
  std::optional<LedgerDifference> make_step(const std::function<void()>& make = {}) {
    stop_if_interrupted();
    const std::int64_t before = trainer_.step();
    if (make) {
      make();
    } else {
      trainer_.train_step();
    }
    if (trainer_.step() % trainer_.steps_per_epoch() == 0) end_epoch(trainer_, task_);
    line_ = writer_->after_step();
    const std::optional<LedgerLine> theirs = ledger_.at(trainer_.step());
    if (!line_ && !theirs) return std::nullopt;
    if (!line_) return LedgerDifference{before, trainer_.step(), "a line too many", false};
    if (!theirs) return LedgerDifference{before, trainer_.step(), "a line that is missing", false};
    return difference(ledger_, *theirs, *line_);
  }
  /// start() and steps up to segment.to, with a progress bar, or to the first difference.
  std::optional<LedgerDifference> repeat(const Segment& segment, const Arguments& a) {
    auto d = start(segment.from);
    const std::int64_t from = trainer_.step();
    Progress progress(a, "repeating", static_cast<std::uint64_t>(segment.to - from), "steps");
    for (; !d && trainer_.step() < segment.to && !trainer_.done();
         progress.update(static_cast<std::uint64_t>(trainer_.step() - from)))
      d = make_step();
    if (!d && (trainer_.step() < segment.to || (segment.to == end_ && !trainer_.done())))
      d = LedgerDifference{trainer_.step(), segment.to, "where it ends", false};
    return d;
  }
  /// Whether the state that was kept at the trainer's step says the same of the best epoch.
  bool same_best() const {
    const auto entries = trainer_.best_entries();
    if (entries.empty()) return true;
    const auto kept = SafetensorsFile::read(LedgerFile::state_path(folder_, trainer_.step()));
    return std::ranges::all_of(
        entries, [&](const auto& entry) { return value_or(kept.metadata(), entry.first) == entry.second; });
  }
  /// The line that the last step gave, if any.
  const std::optional<LedgerLine>& line() const { return line_; }

  Trainer& trainer() { return trainer_; }

 private:
  std::string folder_;
  Ledger ledger_;
  TrainingTask task_;
  Trainer trainer_;
  std::int64_t end_;
  std::optional<LedgerWriter> writer_;
  std::optional<LedgerLine> line_;
};

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

using Segment = Repetition::Segment;

// Those to be repeated, drawn without looking at them, in their order.
std::vector<Segment> drawn(std::vector<Segment> segments, std::size_t count, std::uint64_t seed) {
  const RandomStream random(seed, stream_hashed("audit"));
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const auto rest = static_cast<double>(segments.size() - i);
    std::swap(segments[i], segments[i + static_cast<std::size_t>(random.uniform(i) * rest)]);
  }
  segments.resize(std::min(count, segments.size()));
  std::ranges::sort(segments, {}, &Segment::from);
  return segments;
}

// The model file has to hold the parameters of the last state, or of its best epoch.
bool is_of(const std::string& model, const SuperTac& network) {
  const ModelFile file = load_model(model);
  const auto& a = network.parameters();
  const auto& b = file.model->parameters();
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Parameter& x, const Parameter& y) {
    const auto p = std::as_bytes(x.value.value().values()), q = std::as_bytes(y.value.value().values());
    return x.name == y.name && std::equal(p.begin(), p.end(), q.begin(), q.end());
  });
}

}  // namespace

int check_training(const Arguments& a) {
  const std::string model = a.text("FILE");
  Repetition training(a, model);
  Trainer& trainer = training.trainer();
  const std::vector<Segment> all = training.segments();
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
  for (const Segment& s : chosen) {
    auto d = training.repeat(s, a);
    if (!d && !training.same_best()) d = LedgerDifference{s.from, s.to, "the best epoch", false};
    say("steps " + std::to_string(s.from) + " to " + std::to_string(s.to) + ": ", d,
        {{"from", s.from}, {"to", s.to}});
  }
  auto last = training.start(training.end());
  if (!last && !trainer.done())
    last = LedgerDifference{trainer.step(), trainer.step(), "where it ends", false};
  trainer.use_best();
  if (!last && !is_of(model, trainer.model()))
    last = LedgerDifference{trainer.step(), trainer.step(), "the model's file", false};
  say("the model against what was kept at the end: ", last, {{"model", model}});
  a.print(std::to_string(chosen.size()) + " of " + std::to_string(all.size()) + " segments repeated, " +
          std::to_string(wrong) + " differences");
  a.write_json(
      {{"segments", all.size()}, {"repeated", chosen.size()}, {"differences", wrong}, {"rows", rows}});
  return wrong == 0 ? kExitOk : kExitFailed;
}

namespace {

// The arrays under their hashes, and what the operators are that they belong to.
void write_arrays(const OutputPath& out, const std::map<std::string, Tensor>& arrays, const Json& operators) {
  std::vector<TensorToWrite> tensors;
  for (const auto& [hash, values] : arrays) {
    const std::span<const Dim> shape = values.shape().dims();
    tensors.push_back({hash, "F32", {shape.begin(), shape.end()}, std::as_bytes(values.values())});
  }
  write_safetensors(out, {{"kind", "operators"}, {"operators", operators.dump()}}, tensors);
}

Json whose_name_begins(const Json& operators, const std::string& name) {
  Json some = Json::array();
  for (const Json& ran : operators)
    if (ran["name"].get<std::string>().starts_with(name)) some.push_back(ran);
  return some;
}

}  // namespace

int check_step(const Arguments& a) {
  if (a.given("out") != a.given("operator"))
    throw UsageError("step: --operator says whose arrays --out holds; give both or neither");
  const std::string model = a.text("FILE");
  Repetition training(a, model);
  Trainer& trainer = training.trainer();
  const std::int64_t step = a.integer("step", 1, training.end());
  auto d = training.repeat({step - 1, step - 1}, a);
  OpenedStep opened;
  if (!d) {
    d = training.make_step([&] {
      opened = open_step(trainer, a.given("operator") ? std::optional(a.text("operator")) : std::nullopt);
    });
  }
  while (!d && !training.line()) d = training.make_step();  // up to the line that holds it
  const Json kept =
      a.given("operator") ? whose_name_begins(opened.operators, a.text("operator")) : Json::array();
  if (a.given("operator") && kept.empty() && !d)
    throw UsageError("--operator " + a.text("operator") +
                     ": no operator of this step has a name that begins so; --json "
                     "FILE lists them");
  if (a.given("out") && opened.arrays.empty() && !d)
    throw UsageError("--operator " + a.text("operator") + ": what begins so is computed from nothing");
  if (a.given("out")) write_arrays(a.output("out"), opened.arrays, kept);
  const LedgerLine line = training.line().value_or(LedgerLine());
  a.print(
      "step " + std::to_string(step) + ": " + std::to_string(opened.operators.size()) +
      " operators; the ledger " +
      (d ? text_of(*d) : "has the same line at step " + std::to_string(line.step) + ", chain " + line.chain));
  a.write_json({{"step", step},
                {"line", {{"step", line.step}, {"chain", line.chain}}},
                {"difference", d ? to_json(*d) : Json()},
                {"operators", opened.operators}});
  return d ? kExitFailed : kExitOk;
}

}  // namespace supertac
