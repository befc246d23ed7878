// The ledger of a training: every N steps a line that names the whole state by hashes, each line chained to
// the one before; from time to time the state itself is kept, too. Equal bits make a training checkable:
// a piece of it, repeated from a kept state, has to give the same lines.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/numbers/hash.h"
#include "models/training/trainer.h"

namespace supertac {

struct LedgerLine {
  std::int64_t step = 0;
  std::string batches;  ///< of the indices of every batch since the line before
  /// Of each parameter, of Adam's moments, and where the recipe keeps it of the best epoch's parameters, in
  /// the order of the header.
  std::vector<std::string> tensors;
  std::string chain;  ///< over all that stands here and the chain before

  /// Of a line of the file. Throws std::runtime_error when it is none.
  static LedgerLine of(const std::string& text);
  /// As the file has it; without its chain: what is chained.
  std::string text(bool with_chain = true) const;
};

struct Ledger {
  std::int64_t every = 0;          ///< steps from line to line
  std::vector<std::string> names;  ///< of the tensors
  struct Line {
    std::int64_t step;
    std::string text;
  };
  std::vector<Line> lines;

  /// Throws FileError when the file is no ledger, or a line's chain is not that of what stands before it
  /// (naming the line): it was changed after it had been written.
  static Ledger read(const std::string& path);
  std::optional<LedgerLine> at(std::int64_t step) const;
};

/// Of every array of a trainer's state, as a line has them.
std::vector<std::string> hashes_of(const Trainer& trainer);

/// Hashes the state of a trainer step by step.
class LedgerWriter {
 public:
  /// `previous`: the line it continues behind, at or before the trainer's step; null: the training's
  /// beginning. The trainer must outlive it.
  LedgerWriter(const Trainer& trainer, std::int64_t every, const LedgerLine* previous = nullptr);
  /// To be called after every step: hashes its batch; returns a line every `every` steps and after the last.
  std::optional<LedgerLine> after_step();
  /// The ledger's first line.
  const std::string& header() const { return header_; }

 private:
  const Trainer& trainer_;
  std::int64_t every_;
  std::string header_, chain_;
  Sha256 batches_;
};

/// How a line differs from that of a ledger.
struct LedgerDifference {
  std::int64_t after = 0, step = 0;  ///< it came about behind the one and up to the other
  /// The first tensor that differs at `step`; "the batches" where those differ, and all tensors are the same.
  std::string what;
  bool batches = false;  ///< whether other batches were taken
};
/// Of two lines of the same step; empty when they are the same. Throws std::runtime_error when their number
/// of tensors is not the header's.
std::optional<LedgerDifference> difference(const Ledger& header, const LedgerLine& a, const LedgerLine& b);

/// The ledger of a run, in its folder, and the states kept beside it.
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
