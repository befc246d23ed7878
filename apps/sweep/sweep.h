// A grid of models, each trained into a file and measured into a row of the table.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/common/command_line/arguments.h"
#include "apps/sweep/grid.h"
#include "apps/sweep/table.h"
#include "apps/train/training_run.h"
#include "data/scores/metrics.h"
#include "io/files/folder_lock.h"

namespace supertac {

/// --limit and --history: which test windows are scored; --deadline.
void declare_measuring(Arguments& a);

/// How long another process of a sweep may write its table.
inline constexpr std::chrono::seconds kLongestWriting{30};

class Sweep {
 public:
  /// `a` must have what declare_measuring() and the options of training declare; it and the table must
  /// outlive this. Throws FileError when the folder's settings.json shows that the table began with other
  /// settings: figures that cannot be compared do not mix.
  Sweep(const Arguments& a, SweepTable& table);

  /// Rows that are there are not measured again; a model whose training was cut is trained on. Several
  /// processes may run the same sweep at once, on any machines that see the folder and its locks: each takes
  /// the longest training that nobody has, the rows stand in the order of the grid, and who finds nothing
  /// left waits, to take over from one that is lost. Throws Interrupted after a signal, UsageError,
  /// std::runtime_error when the others have written nothing for --deadline, and as TrainingRun.
  void run(const std::vector<Recipe>& grid);

 private:
  void check_settings() const;
  bool take_one(const std::vector<Recipe>& longest_first);
  void wait_for_others();
  double whole_by(const Recipe& recipe) const;
  void measure(const Recipe& recipe, const std::string& label);
  std::vector<std::uint32_t> windows_to_score(const WindowSet& windows, const Split& split) const;
  nlohmann::ordered_json row(const Recipe& recipe, const TrainingRun& training,
                             const ZoneMetrics& scores) const;

  const Arguments& a_;
  SweepTable& table_;
  std::vector<Recipe> grid_;
  std::vector<std::string> order_;              // of the rows
  std::filesystem::file_time_type last_write_;  // by any process of the sweep
  std::chrono::steady_clock::time_point last_seen_ = std::chrono::steady_clock::now();  // that it changed
};

}  // namespace supertac
