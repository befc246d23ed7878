#include "apps/train/training_run.h"

#include <cmath>
#include <optional>
#include <utility>

#include "apps/common/program.h"
#include "apps/common/progress.h"
#include "apps/common/signals.h"
#include "apps/common/version.h"
#include "apps/train/log_means.h"
#include "io/numbers.h"
#include "models/evaluation.h"

namespace supertac {
namespace {

constexpr std::size_t kTestWindowsPerEpoch = 2000;

// What the model file says of its origin; the same whatever machine, folder or number of threads.
std::map<std::string, std::string> origin(const Arguments& a, std::uint64_t seed, const WindowSet& windows,
                                          const Split& split) {
  return {{"split", a.text("split")},      {"seed", std::to_string(seed)},
          {"plates", a.text("plates")},    {"stride", a.text("stride")},
          {"data", windows.fingerprint()}, {"split_fingerprint", fingerprint(split)}};
}

// Restored before the run folder is touched: a checkpoint that does not fit must leave the folder as it was.
Trainer make_trainer(const WindowSet& windows, const Split& split, const TrainingSettings& settings,
                     const std::string& resume, const std::map<std::string, std::string>& origin) {
  Trainer trainer(windows, split.train, settings);
  if (!resume.empty()) trainer.restore(resume, origin);
  return trainer;
}

nlohmann::ordered_json describe(const Arguments& a, const Trainer& trainer, const WindowSet& windows,
                                const Split& split) {
  const Leakage leakage = find_leakage(windows, split);
  return {
      {"command", a.command_line()},
      {"version", version()},
      {"commit", commit()},
      {"training", nlohmann::ordered_json::parse(trainer.settings().text())},
      {"model", nlohmann::ordered_json::parse(model_metadata(trainer.settings().model, {}).at("settings"))},
      {"parameters", trainer.model().parameter_count()},
      {"split", a.text("split")},
      {"train_windows", split.train.size()},
      {"test_windows", split.test.size()},
      {"test_windows_sharing_frames", leakage.overlapping},
      {"test_windows_duplicated", leakage.duplicated},
      {"windows", windows.counts().summary()},
      {"data", windows.fingerprint()},
      {"split_fingerprint", fingerprint(split)},
      {"steps", trainer.total_steps()}};
}

}  // namespace

TrainingRun::TrainingRun(const Arguments& a, const WindowSet& windows, const Split& split,
                         const TrainingSettings& settings, TrainingTarget target)
    : a_(a),
      windows_(windows),
      split_(split),
      target_(std::move(target)),
      origin_(origin(a, settings.seed, windows, split)),
      trainer_(make_trainer(windows, split, settings, target_.resume, origin_)),
      folder_(target_.out, target_.force,
              target_.resume.empty() ? std::nullopt : std::optional(trainer_.step())),
      description_(describe(a, trainer_, windows, split)) {
  folder_.write_settings(description_);
}

bool TrainingRun::train() {
  a_.note("training on " + std::to_string(split_.train.size()) + " windows, " +
          std::to_string(trainer_.total_steps()) + " steps" +
          (target_.resume.empty() ? "" : ", resumed at " + std::to_string(trainer_.step())));
  const auto sharing = description_.at("test_windows_sharing_frames").get<std::size_t>(),
             duplicated = description_.at("test_windows_duplicated").get<std::size_t>();
  if (a_.text("split") != "none" && sharing + duplicated > 0) {
    a_.note("split " + a_.text("split") + " leaks: of " + std::to_string(split_.test.size()) +
            " test windows " + std::to_string(sharing) + " share frames with training windows, " +
            std::to_string(duplicated) + " repeat one; use --split trial for results");
  }
  step_until_done();
  folder_.write_report(description_);
  if (!trainer_.done()) return false;
  std::map<std::string, std::string> metadata = origin_;
  metadata["training"] = trainer_.settings().text();
  save_model(target_.out, trainer_.model(), input_of(windows_), metadata);
  return true;
}

void TrainingRun::step_until_done() {
  begin_ = std::chrono::steady_clock::now();
  seconds_before_ = folder_.seconds();
  const std::int64_t every = a_.integer("checkpoint-every", 1, 1'000'000'000);
  Progress progress(a_, target_.label, static_cast<std::uint64_t>(trainer_.total_steps()), "steps");
  LogMeans means;
  while (!trainer_.done() && !interrupted()) {
    const StepReport report = trainer_.train_step();
    means.add(report);
    if (report.collapsed && !std::exchange(warned_, true)) {
      a_.note("step " + std::to_string(report.step) + ": " +
              (report.active_latents == 0
                   ? "no latent number tells windows apart; stop and lower --beta (now " + a_.text("beta") +
                         ") or "
                   : "the pictures are the same for every window, or far too strong; stop and lower ") +
              "--learning-rate (now " + format(trainer_.settings().learning_rate) + ")");
    }
    const bool epoch_ends = report.step % trainer_.steps_per_epoch() == 0;
    if (epoch_ends || report.step % LogMeans::kSteps == 0) log(means.take(seconds()), epoch_ends);
    if (report.step % every == 0) save();
    progress.update(static_cast<std::uint64_t>(report.step));
  }
  save();
}

double TrainingRun::seconds() const {
  return seconds_before_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

// The scores of an even sample of the test windows are for the log: nothing is chosen by them.
void TrainingRun::log(LogLine line, bool epoch_ends) {
  if (epoch_ends) {
    const Metrics m = score(trainer_.model(), windows_, spread(split_.test, kTestWindowsPerEpoch)).contact();
    if (std::isfinite(m.ssim)) {
      line.test_ssim = m.ssim;
      line.test_psnr_db = m.psnr_mean_db;
    }
  }
  if (!folder_.log(line)) a_.note(folder_.path() + "/log.csv: cannot write; the log is kept in memory only");
}

}  // namespace supertac
