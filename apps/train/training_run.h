// One model trained into a file.
#pragma once

#include <optional>
#include <string>

#include "apps/common/command_line/arguments.h"
#include "apps/common/running/progress.h"
#include "apps/train/ledger_file.h"
#include "apps/train/run_folder.h"
#include "models/training/train.h"

namespace supertac {

struct TrainingTarget {
  OutputPath out;                ///< the model file; its run folder lies beside it
  bool force = false;            ///< whether an earlier run's folder may be overwritten
  std::string resume;            ///< the checkpoint to continue from; "" = start anew
  Ranks& ranks = one_process();  ///< that train together; only the first writes
};

class TrainingRun {
 public:
  /// `a`, which must have what declare_training() declares, must outlive the run. Throws as Trainer,
  /// Trainer::restore and RunFolder; RanksError when ranks have other data or options.
  TrainingRun(const Arguments& a, TrainingTask task, TrainingTarget target);

  /// Until the last step or a signal. The state is saved either way; after the last step report and model are
  /// written too. Returns whether all steps are done.
  bool train();

  const Trainer& trainer() const { return trainer_; }
  /// The model file, under the name that it got.
  const std::string& out() const { return target_.out.path; }
  /// Of the first rank only.
  const RunFolder& folder() const { return *folder_; }
  /// What settings.json holds: command, version, commit, settings, data, split.
  const nlohmann::ordered_json& description() const { return description_; }

 private:
  TrainingCallbacks callbacks(Progress& progress);
  void write_end();
  std::string detail(const StepReport& report) const;
  void warn_of_collapse(const StepReport& report);

  const Arguments& a_;
  TrainingTask task_;
  TrainingTarget target_;
  Trainer trainer_;
  std::optional<RunFolder> folder_;
  std::optional<LedgerFile> ledger_;
  nlohmann::ordered_json description_;
  bool warned_ = false;
  std::optional<double> loss_, test_ssim_;  // as last logged
};

}  // namespace supertac
