#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "apps/train/ledger_file.h"
#include "models/training/task.h"

namespace supertac {

/// A training with a ledger, made again from the states that it kept.
class Repetition {
 public:
  /// Of the model's run folder, as its file says that it was trained. Throws FileError when that does not say
  /// it, when there is no ledger, or when --data holds other recordings.
  Repetition(const Arguments& a, const std::string& model);

  struct Segment {
    std::int64_t from, to;
  };
  /// From kept state to kept state. Throws FileError when one is missing.
  std::vector<Segment> segments() const;

  /// Goes to the last kept state at or before `step`; what it returns is how the state differs from its line.
  std::optional<LedgerDifference> start(std::int64_t step);
  /// Makes a step, by `make` where it is given, and compares with the ledger where that has a line.
  std::optional<LedgerDifference> make_step(const std::function<void()>& make = {});
  /// The line that the last step gave, if any.
  const std::optional<LedgerLine>& line() const { return line_; }

  const Ledger& ledger() const { return ledger_; }
  Trainer& trainer() { return *trainer_; }

 private:
  std::string folder_;
  Ledger ledger_;
  TrainingTask task_;
  std::optional<Trainer> trainer_;
  std::optional<LedgerWriter> writer_;
  std::optional<LedgerLine> line_;
};

/// "differs at step 7: encoder.0.conv.0.weight", and the same for --json.
std::string text_of(const LedgerDifference& d);
nlohmann::ordered_json to_json(const LedgerDifference& d);

}  // namespace supertac
