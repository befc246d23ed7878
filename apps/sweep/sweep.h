// A grid of models, each trained into a file and measured into a row of the table.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "apps/sweep/grid.h"
#include "apps/sweep/table.h"
#include "apps/train/training_run.h"
#include "data/scores/metrics.h"

namespace supertac {

/// --limit and --history: which test windows are scored.
void declare_measuring(Arguments& a);

class Sweep {
 public:
  /// `a` must have what declare_measuring() and the options of training declare; it and the table must
  /// outlive this. Throws FileError when the folder's settings.json shows that the table began with other
  /// settings: figures that cannot be compared do not mix.
  Sweep(const Arguments& a, SweepTable& table);

  /// Rows that are there are not measured again; a model whose training was cut is trained on. Throws
  /// Interrupted after a signal, UsageError, and as TrainingRun.
  void run(const std::vector<GridPoint>& grid);

 private:
  void check_settings() const;
  void measure(const GridPoint& point, const std::string& label);
  std::vector<std::uint32_t> windows_to_score(const WindowSet& windows, const Split& split) const;
  const WindowSet& windows_of(const SuperTacSettings& model);
  nlohmann::ordered_json row(const GridPoint& point, const TrainingRun& training,
                             const ZoneMetrics& scores) const;

  const Arguments& a_;
  SweepTable& table_;
  std::optional<WindowSet> windows_;
};

}  // namespace supertac
