#include "models/training/task.h"

#include <algorithm>
#include <stdexcept>

#include "data/recordings/resample.h"
#include "data/windows/random_passes.h"
#include "data/windows/signal_remarks.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// Training on signals that are clipped draws zeros without a word.
Scaling scaling_of(const Recipe& recipe, const SignalRange& range, std::vector<std::string>& notes) {
  constexpr double kMostClipped = 0.5, kWorthSaying = 0.01;
  Scaling scaling = recipe.range ? *recipe.range : range.fitted();
  const std::string text = format(scaling.rest) + "," + format(scaling.span);
  const double clipped = range.clipped(scaling);
  const std::string clips = "--range " + text + " clips " + format(100 * clipped, 1) +
                            " % of the signals, which lie at " + range.text();
  if (clipped > kMostClipped) throw std::runtime_error(clips + "; give REST,SPAN that hold them, or auto");
  const double stated = range.stated().rest;
  if (clipped > kWorthSaying || scaling.rest != stated) notes.push_back(clips);
  if (recipe.random_plates > 0 && scaling.rest != stated)
    throw std::invalid_argument("--random-plates imitates a sensor whose signals rest at " + format(stated) +
                                ", as the recordings state; those of these recordings rest at " +
                                format(scaling.rest) +
                                "; record them with a sensor's file that states their range, or leave "
                                "--random-plates out");
  scaling.per_window = recipe.per_window;
  return scaling;
}

// Of the recordings that are tested; the rig's when they differ.
double common_speed(const WindowSet& windows) {
  double speed = 0;
  for (const WindowSet::Pass& pass : windows.passes()) {
    if (pass.windows == 0 || pass.use.training_only || pass.speed_mm_s <= 0) continue;
    if (speed > 0 && pass.speed_mm_s != speed) return rig::kSlideMmS;
    speed = pass.speed_mm_s;
  }
  return speed > 0 ? speed : rig::kSlideMmS;
}

// Who trains and tests on the simulated finger needs no other one; a real finger is not like it.
bool all_simulated(const WindowSet& windows) {
  return std::ranges::all_of(windows.passes(),
                             [](const WindowSet::Pass& pass) { return pass.source == "simulated"; });
}

WindowSet windows_of(const Recipe& recipe, const RecordingFolders& folders, std::vector<std::string>& notes) {
  const auto watch = [&](const std::string& folder) {
    return folders.watch ? folders.watch(folder) : ReadingWatch();
  };
  WindowSettings w;
  w.timesteps = static_cast<int>(recipe.model.timesteps);
  w.scale = static_cast<int>(recipe.model.scale);
  w.rate_hz = recipe.rate_hz;
  w.delay_s = recipe.delay_s;
  w.stride = static_cast<int>(recipe.stride);
  const SignalRange range =
      SignalRange::of_folder(folders.data, recipe.plates, watch(folders.data), recipe.range.has_value());
  range.felt().check();
  w.scaling = scaling_of(recipe, range, notes);
  WindowSet windows = WindowSet::load(folders.data, recipe.plates, w, watch(folders.data));
  const RandomPasses random{.count = static_cast<std::size_t>(recipe.random_plates),
                            .seed = recipe.seed,
                            .speed_mm_s = common_speed(windows),
                            .filter_s = windows.filter_s().value_or(rig::kFilterS),
                            .other_fingers = !all_simulated(windows)};
  add_random_passes(windows, random);
  if (recipe.augment.any()) add_silent_passes(windows, recipe.seed, random.count > 0 && random.other_fingers);
  return windows;
}

}  // namespace

Split split_of(const WindowSet& windows, const Recipe& recipe, std::vector<std::uint32_t>& held_out) {
  Split split = make_split(windows, recipe.split, recipe.seed, recipe.leave_out);
  if (recipe.split == SplitKind::group && recipe.keeps_best)
    held_out = hold_out_group(windows, split, recipe.seed);
  return split;
}

TrainingTask window_task(const Recipe& given, const RecordingFolders& folders) {
  given.check();
  std::vector<std::string> notes;
  const auto windows = std::make_shared<const WindowSet>(windows_of(given, folders, notes));
  Recipe recipe = given;
  set_array(recipe.model, windows->array());
  TrainingTask task{.windows = windows, .objective = Objective(*windows, recipe)};
  task.split = split_of(*windows, recipe, task.held_out);
  task.split.train = subsample_no_contact(*windows, std::move(task.split.train));
  task.origin = metadata_of(recipe);
  task.origin.erase("training");  // the objective says it
  task.origin["data"] = windows->fingerprint();
  task.origin["split_fingerprint"] = fingerprint(task.split);
  task.finds_interval_factor = recipe.split == SplitKind::group && !recipe.interval_factor;
  task.counts = windows->counts().summary();
  task.overlapping = count_overlapping(*windows, task.split);
  task.notes = std::move(notes);
  if (recipe.split != SplitKind::none && task.overlapping > 0)
    task.notes.push_back("split " + name_of(recipe.split) + " leaks: of " +
                         std::to_string(task.split.test.size()) + " test windows " +
                         std::to_string(task.overlapping) +
                         " share frames with training windows; use --split trial for results");
  if (recipe.split == SplitKind::window && recipe.model.timesteps == 1)
    task.notes.emplace_back(
        "split window leaks when frames resemble each other; use --split group for results");
  task.remarks = remarks_on(*windows, task.split.train);
  return task;
}

}  // namespace supertac
