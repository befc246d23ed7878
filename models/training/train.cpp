#include "models/training/train.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "data/recordings/resample.h"
#include "data/windows/random_passes.h"
#include "data/windows/windows.h"
#include "io/numbers/numbers.h"
#include "layers/checkpoint.h"
#include "models/inference/evaluation.h"
#include "models/inference/novelty.h"

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

WindowSet windows_of(const Recipe& recipe, const std::string& recordings, const ReadingWatch& watch,
                     std::vector<std::string>& notes) {
  WindowSettings w;
  w.timesteps = static_cast<int>(recipe.model.timesteps);
  w.scale = static_cast<int>(recipe.model.scale);
  w.rate_hz = recipe.rate_hz;
  w.delay_s = recipe.delay_s;
  w.stride = static_cast<int>(recipe.stride);
  const SignalRange range =
      SignalRange::of_folder(recordings, recipe.plates, watch, recipe.range.has_value());
  if (const std::string found = range.felt().complaint(); !found.empty()) throw std::runtime_error(found);
  w.scaling = scaling_of(recipe, range, notes);
  WindowSet windows = WindowSet::load(recordings, recipe.plates, w, watch);
  const RandomPasses random{.count = static_cast<std::size_t>(recipe.random_plates),
                            .seed = recipe.seed,
                            .speed_mm_s = common_speed(windows),
                            .filter_s = windows.filter_s().value_or(rig::kFilterS),
                            .other_fingers = !all_simulated(windows)};
  add_random_passes(windows, random);
  if (recipe.augment.any()) add_silent_passes(windows, recipe.seed, random.count > 0 && random.other_fingers);
  return windows;
}

constexpr std::size_t kTestedPerEpoch = 2000;
constexpr std::int64_t kStepsPerLine = 50;

// Scores an even sample of `windows`; those in contact count.
Metrics scores_of(const Trainer& trainer, const std::vector<std::uint32_t>& windows) {
  return score(Ensemble({CompiledModel(trainer.model())}), trainer.windows(),
               evenly_spaced(windows, kTestedPerEpoch))
      .contact();
}

// Of an even sample of the training examples, as they are: augmentation hides what is to be noticed.
std::vector<StoredTensor> novelty_of(const Trainer& trainer) {
  constexpr std::size_t kMostSamples = 20'000, kMostOfAFrame = 1024;  // a matrix of their squares is kept
  const WindowSet& data = trainer.windows();
  std::vector<std::uint32_t> in_distribution;
  std::ranges::copy_if(trainer.training_side(), std::back_inserter(in_distribution),
                       [&](std::uint32_t i) { return data.in_distribution(i); });
  const std::vector<std::uint32_t> chosen = evenly_spaced(in_distribution, kMostSamples);
  const std::size_t count = signal_feature_count(data.array(), data.frames());
  if (chosen.size() <= count || (data.frames() == 1 && count > kMostOfAFrame)) return {};
  Tensor features(Shape{static_cast<Dim>(chosen.size()), static_cast<Dim>(count)});
  std::vector<float> window(data.input_size());
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    data.window(chosen[i], window);
    signal_features(window, data.array(), features.values().subspan(i * count, count));
  }
  return Novelty(features).stored();
}

StoredTensor ranges_of(const Trainer& trainer) {
  constexpr std::size_t kSamples = 1024;
  ActivationRanges ranges;
  for_each_output(Ensemble({CompiledModel(trainer.model())}), trainer.windows(),
                  evenly_spaced(trainer.training_side(), kSamples), [&](const EvaluatedBatch& b) {
                    ranges.add(trainer.model(), b.inputs);
                    return true;
                  });
  return ranges.stored();
}

// A wrong name is better found before the training than behind it.
void check_output(const std::string& out) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(out).parent_path();
  std::error_code none;
  if (out.empty() || fs::is_directory(out, none))
    throw FileError(out, "is no name of a file to write a model to");
  if (!folder.empty() && !fs::is_directory(folder, none))
    throw FileError(out, "cannot be written: its folder is missing");
}

}  // namespace

Split split_of(const WindowSet& windows, const Recipe& recipe, std::vector<std::uint32_t>& held_out) {
  Split split = make_split(windows, recipe.split, recipe.seed, recipe.leave_out);
  if (recipe.split == SplitKind::group && recipe.keeps_best)
    held_out = hold_out_group(windows, split, recipe.seed);
  return split;
}

TrainingTask window_task(const Recipe& given, const std::string& recordings, const ReadingWatch& watch) {
  given.check();
  std::vector<std::string> notes;
  const auto windows = std::make_shared<const WindowSet>(windows_of(given, recordings, watch, notes));
  Recipe recipe = given;
  set_array(recipe.model, windows->array());
  TrainingTask task{.windows = windows, .recipe = recipe};
  task.split = split_of(*windows, recipe, task.held_out);
  task.split.train = subsample_no_contact(*windows, std::move(task.split.train));
  task.origin = metadata_of(recipe);
  task.origin.erase("training");  // the trainer says it
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

void end_epoch(Trainer& trainer, const TrainingTask& task) {
  if (!task.held_out.empty()) trainer.epoch_scored(scores_of(trainer, task.held_out).ssim);
}

bool train(Trainer& trainer, const TrainingTask& task, const TrainingCallbacks& callbacks) {
  const auto begin = std::chrono::steady_clock::now();
  const auto save = [&] {  // of several processes all take part, though the first alone has a file
    if (!callbacks.checkpoint.empty() || trainer.ranks() > 1) trainer.save(callbacks.checkpoint, task.origin);
  };
  LogLine sums;
  std::int64_t steps = 0;
  bool stop = callbacks.stop && trainer.ranks() == 1 && callbacks.stop();
  while (!trainer.done() && !stop) {
    const StepReport report = trainer.train_step(callbacks.stop);
    sums.add(report);
    sums.gradient_norm += report.gradient_norm;
    ++steps;
    const bool epoch_ends = report.step % trainer.steps_per_epoch() == 0;
    if (epoch_ends) end_epoch(trainer, task);
    if (callbacks.step) callbacks.step(report);
    if (callbacks.log && (epoch_ends || report.step % kStepsPerLine == 0)) {
      for (double* sum : sums.all()) *sum /= static_cast<double>(steps);
      sums.gradient_norm /= static_cast<double>(steps);
      sums.time_s = callbacks.seconds_before +
                    std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      sums.step = report.step, sums.learning_rate = report.learning_rate;
      if (epoch_ends) {
        const Metrics test = scores_of(trainer, task.split.test);
        if (test.windows > 0) sums.test_ssim = test.ssim, sums.test_psnr_db = test.psnr_mean_db;
      }
      callbacks.log(std::exchange(sums, {}));
      steps = 0;
    }
    if (report.step % callbacks.checkpoint_every == 0) save();
    stop = report.stop || (callbacks.stop && trainer.ranks() == 1 && callbacks.stop());
  }
  save();
  if (trainer.done()) trainer.use_best();
  return trainer.done();
}

std::map<std::string, std::string> trained_origin(const Trainer& trainer, const TrainingTask& task) {
  std::map<std::string, std::string> origin = task.origin;
  if (!task.finds_interval_factor || !trainer.model().settings().predicted_error) return origin;
  const std::vector<std::uint32_t> tested = evenly_spaced(task.split.test, kTestedPerEpoch);
  const Ensemble network({CompiledModel(trainer.model())});
  const auto scale = static_cast<double>(task.windows->scale());
  const auto judged = [&](const std::array<PixelInterval, 2>& intervals) {
    std::array<IntervalCoverage, 2> coverages;
    for (std::size_t i = 0; i < 2; ++i)
      coverages[i] = IntervalCoverage(intervals[i], network.first().format());
    for_each_output(network, *task.windows, tested, [&](const EvaluatedBatch& b) {
      for (std::size_t n = 0; n < b.size(); ++n)
        for (IntervalCoverage& coverage : coverages)
          coverage.add(task.windows->pass_of(tested[b.first + n]), b.output(n), task.windows->image().width,
                       b.target(n), b.predicted_error(n), b.input(n));
      return true;
    });
    return coverages;
  };
  const auto first = judged({PixelInterval{}, PixelInterval{.load = scale * scale}});
  const auto [plain, loaded] = judged({first[0].found(), first[1].found()});
  origin["interval_factor"] = (loaded.half_width() < plain.half_width() ? loaded : plain).judged().text();
  origin["interval_factor_found"] = "tested groups";
  return origin;
}

void save_trained(const Trainer& trainer, const std::string& path,
                  const std::map<std::string, std::string>& origin) {
  std::vector<StoredTensor> more = novelty_of(trainer);
  more.push_back(ranges_of(trainer));
  write_checkpoint(path, trainer.model().parameters(), trainer.metadata(origin), more);
}

bool train(const Recipe& recipe, const std::string& recordings, const std::string& out,
           const TrainingCallbacks& callbacks) {
  check_output(out);
  const TrainingTask task = window_task(recipe, recordings);
  Trainer trainer(*task.windows, task.split.train, task.recipe);
  if (!callbacks.checkpoint.empty() && std::filesystem::exists(callbacks.checkpoint))
    trainer.restore(callbacks.checkpoint, task.origin);
  if (!train(trainer, task, callbacks)) return false;
  save_trained(trainer, out, trained_origin(trainer, task));
  return true;
}

}  // namespace supertac
