// One model trained into a file: what supertac-train does once, and supertac-sweep for each model of a grid.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "apps/common/command_line/arguments.h"
#include "apps/train/ledger_file.h"
#include "apps/train/run_folder.h"
#include "apps/train/training_task.h"
#include "models/training/trainer.h"

namespace supertac {

struct TrainingTarget {
  std::string out;                 ///< the model file; its run folder lies beside it
  bool force = false;              ///< whether an earlier run's folder may be overwritten
  std::string resume;              ///< the checkpoint to continue from; "" = start anew
  std::string label = "training";  ///< of the progress bar
  double whole = 1;                ///< how many times as long as this training the whole command takes
  Ranks& ranks = one_process();    ///< that train together; only the first writes
};

class TrainingRun {
 public:
  /// `a`, which must have what declare_training() declares, and the task's examples must outlive the run.
  /// Throws as Trainer, Trainer::restore and RunFolder; RanksError when ranks have other data or options.
  TrainingRun(const Arguments& a, TrainingTask task, TrainingTarget target);

  /// Until the last step or a signal. The state is saved either way; after the last step report and model are
  /// written too. Returns whether all steps are done.
  bool train();

  const Trainer& trainer() const { return trainer_; }
  /// Of the first rank only.
  const RunFolder& folder() const { return *folder_; }
  const Split& split() const { return task_.split; }
  /// What settings.json holds: command, version, commit, settings, data, split.
  const nlohmann::ordered_json& description() const { return description_; }

 private:
  void step_until_done();
  void write_end();
  double seconds() const;
  std::string detail(const StepReport& report) const;
  void warn_of_collapse(const StepReport& report);
  void test(LogLine& line) const;
  void log(LogLine& means, std::int64_t steps, const StepReport& last);
  void save() { trainer_.save(folder_ ? folder_->checkpoint_path() : "", task_.origin); }

  const Arguments& a_;
  TrainingTask task_;
  TrainingTarget target_;
  Trainer trainer_;
  std::optional<RunFolder> folder_;
  std::optional<LedgerFile> ledger_;
  nlohmann::ordered_json description_;
  std::chrono::steady_clock::time_point begin_;
  double seconds_before_ = 0;  // on the log's clock when this process began
  bool warned_ = false;
  std::optional<double> loss_, test_ssim_;  // as last logged
};

}  // namespace supertac
