// supertac-train: recordings in, a model out.
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "apps/ranks/together.h"
#include "apps/train/training_options.h"
#include "apps/web/pages.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/training/audit/ledger.h"
#include "models/training/train.h"

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

void check_agreement(const Trainer& trainer, const TrainingTask& task, Ranks& ranks) {
  std::map<std::string, std::string> mine = trainer.metadata(task.origin);
  mine["build"] = version() + " " + commit();
  mine["step"] = std::to_string(trainer.step());
  if (const auto odd = find_disagreement(ranks, mine))
    throw RanksError("rank " + std::to_string(odd->rank) + ": its " + odd->entry + " is " + odd->its +
                     ", that of rank 0 is " + odd->of_first +
                     "; start all with the same build, data and options");
  trainer.check_same();
}

// Restored before the run folder is touched: a checkpoint that does not fit must leave the folder as it was.
Trainer make_trainer(TrainingTask& task, const std::string& resume, Ranks& ranks) {
  Trainer trainer(*task.windows, task.split.train, task.recipe, ranks);
  if (!resume.empty()) trainer.restore(resume, task.origin);
  if (ranks.size() > 1) check_agreement(trainer, task, ranks);
  return trainer;
}

nlohmann::ordered_json describe(const Arguments& a, const Trainer& trainer, const TrainingTask& task) {
  using Json = nlohmann::ordered_json;
  const auto said = trainer.metadata({});
  return {{"command", a.command_line()},
          {"version", version()},
          {"commit", commit()},
          {"training", Json::parse(said.at("training"))},
          {"model", Json::parse(said.at("settings"))},
          {"parameters", trainer.model().parameter_count()},
          {"split", task.origin.at("split")},
          {"train_windows", task.split.train.size()},
          {"test_windows", task.split.test.size()},
          {"test_windows_sharing_frames", task.overlapping},
          {"windows", task.counts},
          {"data", task.origin.at("data")},
          {"split_fingerprint", task.origin.at("split_fingerprint")},
          {"steps", trainer.total_steps()}};
}

constexpr const char* kLogHeader =
    "time_s,step,total,reconstruction,kld,l2,ssim,gradient_norm,learning_rate,test_ssim,test_psnr_db\n";
constexpr std::uint64_t kMaxLogBytes = 64 << 20;

std::string csv(const LogLine& line) {
  std::string out = format(line.time_s, 3) + "," + std::to_string(line.step);
  for (const double v : {line.total, line.reconstruction, line.kld, line.l2, line.ssim, line.gradient_norm,
                         line.learning_rate})
    out += "," + format(v);
  out += "," + (line.test_ssim ? format(*line.test_ssim, 5) : "");
  out += "," + (line.test_psnr_db ? format(*line.test_psnr_db, 3) : "");
  return out + "\n";
}

// The log up to a step. A damaged line (the last one of a killed run) is left out.
std::string read_log(const std::string& path, std::int64_t last_step) {
  constexpr std::size_t kColumns = 11;
  std::string log = kLogHeader;
  if (!std::filesystem::exists(path)) return log;
  std::istringstream in(read_text_file(path, kMaxLogBytes));
  std::string line;
  std::getline(in, line);  // the header
  while (std::getline(in, line)) {
    const std::vector<std::string> fields = comma_list(line + ",");
    const auto step = fields.size() == kColumns ? parse_int(fields[1]) : std::nullopt;
    if (step && *step <= last_step) log += line + "\n";
  }
  return log;
}

// What a training run leaves behind besides the model: settings.json, log.csv, last.safetensors, report.html.
class RunFolder {
 public:
  /// run_folder_of() a model. A new run refuses an existing one unless `force`; a resumed run keeps the log's
  /// lines up to `resumed_step`. Throws FileError.
  RunFolder(const std::string& model_file, bool force, std::optional<std::int64_t> resumed_step)
      : path_(run_folder_of(model_file)) {
    if (path_ == model_file)
      throw FileError(path_,
                      "a name that ends in .run is that of the folder beside a model; choose another --out");
    if (std::filesystem::exists(path_) && !force && !resumed_step)
      throw FileError(path_, "is the folder of an earlier run; " +
                                 (std::filesystem::exists(checkpoint_path())
                                      ? "resume it with --resume " + checkpoint_path() + ", "
                                      : std::string()) +
                                 "overwrite it with --force, or choose another --out");
    make_directories(path_);
    lock_ = std::make_unique<FolderLock>(path_);
    log_ = resumed_step ? read_log(log_path(), *resumed_step) : kLogHeader;
    write_file(log_path(), log_);
  }

  const std::string& path() const { return path_; }
  std::string checkpoint_path() const { return path_ + "/last.safetensors"; }
  std::string log_path() const { return path_ + "/log.csv"; }
  /// Seconds on the clock of the log at its last line; 0 when there is none.
  double seconds() const {
    const std::size_t last_line = log_.rfind('\n', log_.size() - 2) + 1;
    return parse_double(log_.substr(last_line, log_.find(',', last_line) - last_line)).value_or(0);
  }

  void write_settings(const nlohmann::ordered_json& settings) const {
    write_file(path_ + "/settings.json", settings.dump(2) + "\n");
  }
  /// Appends and flushes. When the disk refuses, returns false, once; later lines are then kept in memory
  /// only.
  bool log(const LogLine& line) {
    log_ += csv(line);
    if (log_broken_) return true;
    std::ofstream out(log_path(), std::ios::app);
    out << csv(line) << std::flush;
    log_broken_ = !out;
    return !log_broken_;
  }
  /// A page with curves that needs no other file. Throws FileError.
  void write_report() const {
    write_file(path_ + "/report.html", result_page({{"title", "SuperTac training"}, {"log", log_}}));
  }

 private:
  std::string path_;
  std::unique_ptr<FolderLock> lock_;
  std::string log_;
  bool log_broken_ = false;
};

class TrainingRun {
 public:
  TrainingRun(const Arguments& a, TrainingTask task, Ranks& ranks)
      : a_(a),
        task_(std::move(task)),
        out_(a.output("out")),
        trainer_(make_trainer(task_, a.text("resume"), ranks)),
        description_(describe(a, trainer_, task_)) {
    if (a_.given("ledger") && ranks.size() > 1)
      throw UsageError("--ledger: of one process only; leave it out under mpirun");
    if (!ranks.first()) return;
    folder_.emplace(out_.path, a.force(), a.given("resume") ? std::optional(trainer_.step()) : std::nullopt);
    folder_->write_settings(description_);
    if (a_.given("ledger"))
      ledger_.emplace(folder_->path(), a_.integer("ledger", 1, 1'000'000'000), trainer_, task_.origin);
  }

  /// Until the last step or a signal. The state is saved either way; after the last step report and model are
  /// written too. Returns the exit code.
  int train() {
    a_.note(task_.counts);
    for (const std::string& one : task_.remarks) a_.note("warning: " + one);
    a_.note("training on " + std::to_string(task_.split.train.size()) + " windows, " +
            std::to_string(trainer_.total_steps()) + " steps" +
            (a_.given("resume") ? ", resumed at " + std::to_string(trainer_.step()) : ""));
    for (const std::string& note : task_.notes) a_.note(note);
    {
      Progress progress(a_, "training", static_cast<std::uint64_t>(trainer_.total_steps()), "steps",
                        static_cast<std::uint64_t>(trainer_.step()));
      supertac::train(trainer_, task_, callbacks(progress));
    }
    const int code = trainer_.done() ? kExitOk : kExitFailed;
    if (!folder_) return code;
    write_end();
    if (!trainer_.done()) {
      a_.note("stopped at step " + std::to_string(trainer_.step()) + " of " +
              std::to_string(trainer_.total_steps()) + "; continue with the same options and --resume " +
              folder_->checkpoint_path());
      return code;
    }
    a_.print(out_.path + ": " + std::to_string(trainer_.model().parameter_count()) + " parameters after " +
             std::to_string(trainer_.step()) + " steps; curves in " + folder_->path() + "/report.html");
    description_["out"] = out_.path;
    a_.write_json(description_);
    return code;
  }

 private:
  // Report and settings with the time that it took, and the model.
  void write_end() {
    description_["provenance"] = full_provenance();
    if (trainer_.done()) {
      const std::string finished = folder_->path() + "/model.safetensors";
      const auto origin = trained_origin(trainer_, task_);
      if (task_.finds_interval_factor && origin.contains("interval_factor"))
        a_.note("intervals of " + origin.at("interval_factor") +
                " (--interval-factor) hold 90 % of the tested groups' pixels at each height of the truth");
      if (trainer_.best_epoch() > 0)
        a_.note("the network of epoch " + std::to_string(trainer_.best_epoch()) + " of " +
                std::to_string(trainer_.step() / trainer_.steps_per_epoch()) +
                " is kept: it drew the group that was held out best (contact SSIM " +
                format(trainer_.best_score(), 3) + ")");
      save_trained(trainer_, finished, origin);
      out_.path = publish(finished, out_);
      description_["content"] = hash_of_file(out_.path);
    }
    folder_->write_settings(description_);
    folder_->write_report();
  }

  TrainingCallbacks callbacks(Progress& progress) {
    TrainingCallbacks callbacks{.stop = interrupted};
    callbacks.checkpoint_every = a_.integer("checkpoint-every", 1, 1'000'000'000);
    callbacks.step = [this, &progress](const StepReport& report) {
      if (ledger_) ledger_->after_step();
      if (report.collapsed && !std::exchange(warned_, true)) warn_of_collapse(report);
      progress.update(static_cast<std::uint64_t>(report.step), detail(report));
    };
    if (!folder_) return callbacks;
    callbacks.checkpoint = folder_->checkpoint_path();
    callbacks.seconds_before = folder_->seconds();
    callbacks.log = [this](const LogLine& line) {
      loss_ = line.total;
      if (line.step % trainer_.steps_per_epoch() == 0) test_ssim_ = line.test_ssim;
      if (!folder_->log(line))
        a_.note(folder_->log_path() + ": cannot write; the log is kept in memory only");
    };
    return callbacks;
  }

  std::string detail(const StepReport& report) const {
    const std::int64_t epoch = trainer_.steps_per_epoch();
    std::string text = "epoch " + std::to_string((report.step - 1) / epoch + 1) + "/" +
                       std::to_string(trainer_.total_steps() / epoch) + " loss " +
                       format(loss_.value_or(report.total), 3);
    if (test_ssim_) text += " test SSIM " + format(*test_ssim_, 3);
    return text;
  }

  void warn_of_collapse(const StepReport& report) {
    const bool idle = trainer_.recipe().model.latents() > 0 && report.active_latents == 0;
    const std::string advice =
        idle ? "no latent number tells windows apart; if that stays so, lower --beta (now " +
                   format(trainer_.recipe().loss.beta) + ") or "
             : "the pictures are the same for every input, or far too strong; if that stays so, lower ";
    a_.note("step " + std::to_string(report.step) + ": " + advice + "--learning-rate (now " +
            format(trainer_.recipe().learning_rate) + "); early in a run it often mends itself: watch SSIM");
  }

  const Arguments& a_;
  TrainingTask task_;
  OutputPath out_;
  Trainer trainer_;
  std::optional<RunFolder> folder_;
  std::optional<LedgerFile> ledger_;
  nlohmann::ordered_json description_;
  bool warned_ = false;
  std::optional<double> loss_, test_ssim_;  // as last logged
};

}  // namespace

// Only the first of the ranks writes.
int run(Arguments& a) {
  return together(a, [&](Ranks& ranks) {
    const Recipe recipe = recipe_of(a);
    as_usage([&] { check_micro_batches(ranks.size(), static_cast<std::size_t>(recipe.batch)); });
    TrainingTask task = window_task(recipe, a.text("data"), reading_progress(a));
    add_parent("recordings", hash_of_recordings(a.text("data"), recipe.plates));
    return TrainingRun(a, std::move(task), ranks).train();
  });
}

}  // namespace supertac
