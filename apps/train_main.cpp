// supertac-train: recordings in, a model out.
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/ranks/together.h"
#include "apps/train/training_options.h"
#include "apps/train/training_run.h"
#include "data/recordings/recording.h"

namespace supertac {

void declare(Arguments& a) {
  a.required("data", "DIR", "recordings to train on (supertac-simulate, -import, -collect)");
  a.required("out", "FILE",
             "the model; FILE's run folder beside it (.run) holds log, report and the state to resume")
      .writes();
  a.option("resume", "FILE", "continue from the last.safetensors of an interrupted run, same options");
  a.option("seed", "N", "of split, initial weights, order, noise", "0");
  declare_training(a);
}

namespace {

int train(const Arguments& a, TrainingTask task, Ranks& ranks) {
  const std::string about = task.counts;
  const std::vector<std::string> remarks = task.remarks;
  TrainingRun training(
      a, std::move(task),
      {.out = a.output("out"), .force = a.force(), .resume = a.text("resume"), .ranks = ranks});
  a.note(about);  // what ends a training before it has begun says one line only
  for (const std::string& one : remarks) a.note("warning: " + one);
  const bool done = training.train();
  const Trainer& trainer = training.trainer();
  if (!ranks.first()) return done ? kExitOk : kExitFailed;
  if (!done) {
    a.note("stopped at step " + std::to_string(trainer.step()) + " of " +
           std::to_string(trainer.total_steps()) + "; continue with the same options and --resume " +
           training.folder().checkpoint_path());
    return kExitFailed;
  }
  a.print(training.out() + ": " + std::to_string(trainer.model().parameter_count()) + " parameters after " +
          std::to_string(trainer.step()) + " steps; curves in " + training.folder().path() + "/report.html");
  nlohmann::ordered_json result = training.description();
  result["out"] = training.out();
  a.write_json(result);
  return kExitOk;
}

TrainingTask windows_of(const Arguments& a, const Recipe& recipe) {
  TrainingTask task = window_task(recipe, folders_of(a));
  add_parent("recordings", hash_of_recordings(a.text("data"), recipe.plates));
  return task;
}

int train(const Arguments& a, Ranks& ranks) {
  as_usage([&] { check_micro_batches(ranks.size(), 8); });
  return train(a, windows_of(a, recipe_of(a)), ranks);
}

}  // namespace

int run(Arguments& a) {
  return together(a, [&](Ranks& ranks) { return train(a, ranks); });
}

}  // namespace supertac
