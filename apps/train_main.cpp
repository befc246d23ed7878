// supertac-train: recordings (or pairs of images) in, a model out.
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/output/remarks.h"
#include "apps/ranks/together.h"
#include "apps/train/training_options.h"
#include "apps/train/training_run.h"
#include "data/windows/signal_remarks.h"
#include "io/files/file.h"

namespace supertac {

void declare(Arguments& a) {
  a.option("data", "DIR", "recordings to train on (supertac-simulate, -import, -collect)");
  a.option(
      "pairs", "FILE",
      "instead of --data: images of any sensor, safetensors with input [N,C,H,W], target [N,1,sH,sW] in 0 "
      "to 1, optional group [N]; trains a network of single frames");
  a.one_of("data", "pairs");
  a.required("out", "FILE",
             "the model; FILE's run folder beside it (.run) holds log, report and the state to resume");
  a.option("resume", "FILE", "continue from the last.safetensors of an interrupted run, same options");
  a.option("seed", "N", "of split, initial weights, order, noise", "0");
  declare_strict(a);
  declare_training(a);
  declare_network(a);
  a.only_with("");
  declare_together(a);
}

namespace {

// `remarks` and `about` are for a training that has begun: what ends it before says one line only.
int train(const Arguments& a, TrainingTask task, const std::vector<std::string>& remarks,
          const std::string& about, Ranks& ranks) {
  const std::string out = a.text("out");
  if (a.flag("strict")) remark(a, remarks);
  TrainingRun training(a, std::move(task),
                       {.out = out, .force = a.force(), .resume = a.text("resume"), .ranks = ranks});
  a.note(about);
  remark(a, remarks);
  const bool done = training.train();
  const Trainer& trainer = training.trainer();
  if (!ranks.first()) return done ? kExitOk : kExitFailed;
  if (!done) {
    a.note("stopped at step " + std::to_string(trainer.step()) + " of " +
           std::to_string(trainer.total_steps()) + "; continue with the same options and --resume " +
           training.folder().checkpoint_path());
    return kExitFailed;
  }
  a.print(out + ": " + std::to_string(trainer.model().parameter_count()) + " parameters after " +
          std::to_string(trainer.step()) + " steps; curves in " + training.folder().path() + "/report.html");
  nlohmann::ordered_json result = training.description();
  result["out"] = out;
  a.write_json(result);
  return kExitOk;
}

int train(const Arguments& a, Ranks& ranks) {
  try {
    check_micro_batches(ranks.size(), 8);
  } catch (const std::invalid_argument& error) {
    throw UsageError(error.what());
  }
  if (a.given("pairs")) {
    refuse_existing(a.text("out"), a.force());
    PairSet pairs = PairSet::read(a.text("pairs"));
    add_parent_file("pairs", a.text("pairs"));
    TrainingTask task = pair_task(a, pairs);
    return train(a, std::move(task), remarks_on(pairs), std::to_string(pairs.size()) + " pairs", ranks);
  }
  TrainingSettings settings = network_settings(a);
  training_split(a);
  refuse_existing(a.text("out"), a.force());
  const WindowSet windows = training_windows(a, settings.model, settings.seed);
  const auto add_folder = [&](const char* role, const std::string& folder,
                              const std::vector<std::string>& plates) {
    const auto known = windows.content(folder);
    add_parent(role, known ? *known : hash_of_recordings(folder, plates));
  };
  add_folder("recordings", a.text("data"), a.list("plates"));
  if (a.given("also")) add_folder("also", a.text("also"), {});
  set_array(settings.model, windows.array());
  TrainingTask task = window_task(a, windows, settings);
  const std::vector<std::string> remarks = remarks_on(windows, task.split.train);
  return train(a, std::move(task), remarks, windows.counts().summary(), ranks);
}

}  // namespace

int run(Arguments& a) {
  return together(a, [&](Ranks& ranks) { return train(a, ranks); });
}

}  // namespace supertac
