#include "apps/train/training_task.h"

#include "apps/train/training_options.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

std::map<std::string, std::string> origin_of(const std::string& split_name, std::uint64_t seed,
                                             const Examples& examples, const Split& split) {
  return {{"split", split_name},
          {"seed", std::to_string(seed)},
          {"data", examples.fingerprint()},
          {"split_fingerprint", fingerprint(split)}};
}

}  // namespace

TrainingTask window_task(const Arguments& a, const WindowSet& windows, const TrainingSettings& settings) {
  const std::string name = a.text("split");
  TrainingTask task{.examples = windows,
                    .unit = "windows",
                    .split = make_split(windows, training_split(a), settings.seed, a.list("leave-out")),
                    .objective = window_objective(windows, settings)};
  task.split.train = without_most_silence(windows, std::move(task.split.train));
  task.origin = origin_of(name, settings.seed, windows, task.split);
  task.origin["plates"] = a.text("plates");
  task.origin["stride"] = a.text("stride");
  if (a.given("interval-factor"))
    task.origin["interval_factor"] = format(a.number("interval-factor", 0.1, 100));
  if (a.given("leave-out")) task.origin["leave_out"] = a.text("leave-out");
  if (a.given("random-plates")) task.origin["random_plates"] = a.text("random-plates");
  const Leakage leakage = find_leakage(windows, task.split);
  task.about = {{"test_windows_sharing_frames", leakage.overlapping},
                {"test_windows_duplicated", leakage.duplicated},
                {"windows", windows.counts().summary()}};
  if (name != "none" && !leakage.none())
    task.warning = "split " + name + " leaks: of " + std::to_string(task.split.test.size()) +
                   " test windows " + std::to_string(leakage.overlapping) +
                   " share frames with training windows, " + std::to_string(leakage.duplicated) +
                   " repeat one; use --split trial for results";
  return task;
}

TrainingTask pair_task(const Arguments& a, PairSet& pairs) {
  const std::string name = a.given("split")  ? a.choice("split", {"group", "pair", "none"})
                           : pairs.grouped() ? "group"
                                             : "pair";
  FrameTrainingSettings settings;
  read_pace(a, settings);
  settings.seed = a.seed();
  settings.lambda = a.number("lambda", 0, 1e6);
  Split split = split_pairs(pairs, name, settings.seed);
  pairs.fit_scaling(split.train);
  TrainingTask task{.examples = pairs,
                    .unit = "pairs",
                    .split = std::move(split),
                    .objective = frame_objective(pairs, settings)};
  task.origin = origin_of(name, settings.seed, pairs, task.split);
  if (name == "pair")
    task.warning = "split pair leaks when frames resemble each other; use groups for results";
  return task;
}

}  // namespace supertac
