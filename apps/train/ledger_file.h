// The ledger of a run (models/training/audit/ledger.h) and the states kept beside it, in the run's folder.
#pragma once

#include <map>
#include <string>

#include "models/training/audit/ledger.h"

namespace supertac {

class LedgerFile {
 public:
  /// A trainer that has made no step begins a ledger; another one continues that of the folder, whose lines
  /// behind its step are dropped. The trainer must outlive it. Throws FileError; std::runtime_error for a
  /// resumed run whose ledger is missing or of another N.
  LedgerFile(const std::string& run_folder, std::int64_t every, const Trainer& trainer,
             std::map<std::string, std::string> origin);
  /// Throws FileError when a line or a state cannot be written: a ledger with holes proves nothing.
  void after_step();

  static std::string path_in(const std::string& run_folder) { return run_folder + "/ledger.jsonl"; }
  /// Steps from kept state to kept state: about a twentieth of the training, in whole lines.
  static std::int64_t apart(std::int64_t every, std::int64_t total_steps);
  static std::string state_path(const std::string& run_folder, std::int64_t step);

 private:
  LedgerWriter continued(const std::string& run_folder) const;
  void keep_state() const;

  std::string folder_;
  std::int64_t every_;
  const Trainer& trainer_;
  std::map<std::string, std::string> origin_;
  LedgerWriter writer_;
};

}  // namespace supertac
