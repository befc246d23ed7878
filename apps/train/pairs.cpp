#include "apps/train/pairs.h"

#include <chrono>
#include <optional>
#include <utility>

#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/common/version.h"
#include "apps/train/log_means.h"
#include "data/scores/metrics.h"
#include "io/file.h"
#include "io/numbers.h"
#include "models/pair_trainer.h"

namespace supertac {
namespace {

constexpr std::size_t kTestPairsPerEpoch = 2000;

void refuse_options_of_recordings(const Arguments& a) {
  for (const char* name : {"data", "also", "preset", "timesteps", "latent", "scale", "grouping", "rate",
                           "stride", "scaling", "augment", "loss-a", "beta", "plates", "autoencoder"}) {
    if (a.given(name))
      throw UsageError(std::string("--") + name + ": is about recordings and has no meaning with --pairs");
  }
}

std::string split_name(const Arguments& a, const PairSet& pairs) {
  if (a.given("split")) return a.choice("split", {"group", "pair", "none"});
  return pairs.grouped() ? "group" : "pair";
}

PairTrainingSettings settings_of(const Arguments& a, const PairSet& pairs) {
  PairTrainingSettings s = PairTrainingSettings::of(pairs);
  s.lambda = a.number("lambda", 0, 1e6);
  if (a.given("epochs")) s.epochs = a.integer("epochs", 1, 100'000);
  s.batch = a.integer("batch", 1, 4096);
  s.seed = static_cast<std::uint64_t>(a.integer("seed", 0, std::numeric_limits<std::int64_t>::max()));
  if (a.given("learning-rate")) s.optimiser.learning_rate = a.number("learning-rate", 1e-9, 1);
  return s;
}

/// One training, like TrainingRun for recordings.
class PairRun {
 public:
  PairRun(const Arguments& a, const PairSet& pairs, const std::string& split)
      : a_(a),
        pairs_(pairs),
        split_(split_pairs(pairs, split, settings_of(a, pairs).seed)),
        origin_{{"split", split},
                {"seed", std::to_string(settings_of(a, pairs).seed)},
                {"data", pairs.fingerprint()},
                {"split_fingerprint", fingerprint(split_)}},
        trainer_(restored()),
        folder_(a.text("out"), a.force(), a.given("resume") ? std::optional(trainer_.step()) : std::nullopt) {
    folder_.write_settings(description());
  }

  /// Returns whether all steps are done; if not, the state is saved.
  bool train() {
    const std::int64_t every = a_.integer("checkpoint-every", 1, 1'000'000'000);
    begin_ = std::chrono::steady_clock::now();
    seconds_before_ = folder_.seconds();
    Progress progress(a_, "training", static_cast<std::uint64_t>(trainer_.total_steps()), "steps");
    LogMeans means;
    while (!trainer_.done() && !interrupted()) {
      const StepReport report = trainer_.train_step();
      means.add(report);
      if (report.collapsed && !std::exchange(warned_, true))
        a_.note("step " + std::to_string(report.step) +
                ": the pictures are the same for every input; stop and lower --learning-rate (now " +
                format(trainer_.settings().optimiser.learning_rate) + ")");
      const bool epoch_ends = report.step % trainer_.steps_per_epoch() == 0;
      if (epoch_ends || report.step % LogMeans::kSteps == 0) log(means.take(seconds()), epoch_ends);
      if (report.step % every == 0) trainer_.save(folder_.checkpoint_path(), origin_);
      progress.update(static_cast<std::uint64_t>(report.step));
    }
    trainer_.save(folder_.checkpoint_path(), origin_);
    folder_.write_report(description());
    if (!trainer_.done()) return false;
    auto metadata = origin_;
    metadata["training"] = trainer_.settings().text();
    save_frame_model(a_.text("out"), trainer_.model(), trainer_.scaling(), metadata);
    return true;
  }

  nlohmann::ordered_json description() const {
    const auto json = [](const std::string& text) { return nlohmann::ordered_json::parse(text); };
    return {{"command", a_.command_line()},
            {"version", version()},
            {"commit", commit()},
            {"training", json(trainer_.settings().text())},
            {"model", json(frame_metadata(trainer_.settings().model, trainer_.scaling()).at("settings"))},
            {"parameters", trainer_.model().parameter_count()},
            {"split", origin_.at("split")},
            {"train_pairs", split_.train.size()},
            {"test_pairs", split_.test.size()},
            {"data", origin_.at("data")},
            {"split_fingerprint", origin_.at("split_fingerprint")},
            {"steps", trainer_.total_steps()}};
  }
  const PairTrainer& trainer() const { return trainer_; }
  const RunFolder& folder() const { return folder_; }

 private:
  // Restored before the run folder is touched: a checkpoint that does not fit must leave it as it was.
  PairTrainer restored() const {
    PairTrainer trainer(pairs_, split_.train, settings_of(a_, pairs_));
    if (a_.given("resume")) trainer.restore(a_.text("resume"), origin_);
    return trainer;
  }
  double seconds() const {
    return seconds_before_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }
  // The scores of an even sample of the test pairs are for the log: nothing is chosen by them.
  void log(LogLine line, bool epoch_ends) {
    if (epoch_ends && !split_.test.empty()) {
      const std::vector<std::uint32_t> tested = spread(split_.test, kTestPairsPerEpoch);
      PairMetrics metrics(pairs_.target_height(), pairs_.target_width());
      std::vector<float> target(pairs_.target_height() * pairs_.target_width());
      for_each_picture(trainer_.model(), trainer_.scaling(), pairs_, tested,
                       [&](std::size_t i, auto picture) {
                         pairs_.target(tested[i], target);
                         metrics.add(picture, target);
                         return !interrupted();
                       });
      line.test_ssim = metrics.result().ssim;
      line.test_psnr_db = metrics.result().psnr_mean_db;
    }
    if (!folder_.log(line))
      a_.note(folder_.path() + "/log.csv: cannot write; the log is kept in memory only");
  }

  const Arguments& a_;
  const PairSet& pairs_;
  Split split_;
  std::map<std::string, std::string> origin_;
  PairTrainer trainer_;
  RunFolder folder_;
  std::chrono::steady_clock::time_point begin_;
  double seconds_before_ = 0;  // on the log's clock, when the run was resumed
  bool warned_ = false;
};

}  // namespace

int train_on_pairs(const Arguments& a) {
  refuse_options_of_recordings(a);
  const std::string out = a.text("out");
  refuse_existing(out, a.force());
  const PairSet pairs = PairSet::read(a.text("pairs"));
  const std::string split = split_name(a, pairs);
  PairRun run(a, pairs, split);
  if (split == "pair") a.note("split pair leaks when frames resemble each other; use groups for results");
  a.note("training on " + run.description()["train_pairs"].dump() + " pairs of " +
         std::to_string(pairs.channels()) + " x " + std::to_string(pairs.height()) + " x " +
         std::to_string(pairs.width()) + ", scale " + std::to_string(pairs.scale()) + ", " +
         std::to_string(run.trainer().total_steps()) + " steps");
  if (!run.train()) {
    a.note("stopped at step " + std::to_string(run.trainer().step()) + " of " +
           std::to_string(run.trainer().total_steps()) + "; continue with the same options and --resume " +
           run.folder().checkpoint_path());
    return kExitFailed;
  }
  a.print(out + ": " + std::to_string(run.trainer().model().parameter_count()) + " parameters after " +
          std::to_string(run.trainer().step()) + " steps; curves in " + run.folder().path() + "/report.html");
  nlohmann::ordered_json result = run.description();
  result["out"] = out;
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
