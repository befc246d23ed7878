// supertac-sweep: trains and measures a grid of models, and draws accuracy against latency.
#include <filesystem>

#include "apps/common/command_line/program.h"
#include "apps/common/running/launch.h"
#include "apps/sweep/chart.h"
#include "apps/sweep/front.h"
#include "apps/sweep/sweep.h"
#include "apps/train/training_options.h"
#include "io/files/file.h"
#include "io/files/folder_lock.h"

namespace supertac {

namespace fs = std::filesystem;

void declare(Arguments& a) {
  a.required("out", "DIR", "sweep.csv, chart.html and models; a sweep that was stopped goes on where it was");
  a.option("data", "DIR", "recordings to train and test on; without it only the table in --out is read");
  a.option("pick", "CONDITIONS",
           "name the fastest model for which they hold, e.g. \"ssim>=0.8,position_mm<=0.5\"");
  a.only_with("data");
  declare_grid(a);
  declare_training(a);
  declare_window_training(a);
  declare_measuring(a.more());
}

int run(Arguments& a) {
  join_launch(a);
  const std::string out = a.text("out");
  const std::vector<Condition> conditions =
      a.given("pick") ? conditions_of(a.text("pick")) : std::vector<Condition>{};
  if (!a.given("data") && !fs::exists(out + "/sweep.csv"))
    throw UsageError("--data is needed: there is no " + out + "/sweep.csv to read");
  make_directories(out);
  SweepTable table(out + "/sweep.csv");
  if (table.dropped_a_cut_line()) a.note(out + "/sweep.csv: the last line was cut off and is left out");
  if (a.given("data")) {
    const std::vector<Recipe> grid = grid_of(a);
    Sweep(a, table).run(grid);
  }
  const FolderLock alone = lock_within(kLongestWriting, out);
  const std::vector<Configuration> all = configurations(table), front = pareto_front(all);
  write_file(out + "/chart.html", sweep_page(all, a.command_line(), commit()));
  a.print("Pareto front, fastest first:");
  nlohmann::ordered_json result = {{"configurations", all.size()}, {"rows", table.rows().size()}};
  for (const Configuration& c : front) {
    a.print("  " + line_of(c));
    result["front"].push_back(to_json(c));
  }
  int code = kExitOk;
  if (a.given("pick")) {
    const Configuration* best = cheapest(all, conditions);
    if (best == nullptr) {
      a.note("no configuration meets " + a.text("pick") + "; the front shows what there is");
      code = kExitFailed;
    } else {
      a.print("fastest with " + a.text("pick") + ":");
      a.print("  " + line_of(*best));
      for (const std::string& model : best->models) a.print("  " + out + "/models/" + model + ".safetensors");
      result["pick"] = to_json(*best);
    }
  }
  a.write_json(result);
  return code;
}

}  // namespace supertac
