// supertac-sweep: trains and measures a grid of models, and draws accuracy against latency.
#include <filesystem>
#include <optional>

#include "apps/common/measure.h"
#include "apps/common/program.h"
#include "apps/common/signals.h"
#include "apps/common/version.h"
#include "apps/sweep/chart.h"
#include "apps/sweep/front.h"
#include "apps/sweep/grid.h"
#include "apps/sweep/table.h"
#include "apps/train/training_options.h"
#include "apps/train/training_run.h"
#include "io/file.h"
#include "io/json.h"
#include "io/numbers.h"
#include "models/cost.h"
#include "models/evaluation.h"

namespace supertac {

namespace fs = std::filesystem;

void declare(Arguments& a) {
  a.required("out", "DIR", "sweep.csv, chart.png and models; a sweep that was stopped goes on where it was");
  a.option("data", "DIR", "recordings to train and test on; without it only the table in --out is read");
  declare_grid(a);
  declare_training(a);
  a.option("limit", "N", "score at most N test windows, evenly spread; 0 = all", "0");
  a.option("history", "N",
           "score only windows with N frames of their pass behind them: with the longest of --timesteps, all "
           "models are judged on the same frames; 0 = all",
           "0");
  a.option("pick", "CONDITIONS",
           "name the fastest model for which they hold, e.g. \"ssim>=0.8,position_mm<=0.5\"");
}

namespace {

// What all rows of a table have in common, so that figures of different settings cannot be mixed.
void check_settings(const Arguments& a) {
  const TrainingSettings training = training_settings(a, {});
  nlohmann::ordered_json settings = nlohmann::ordered_json::parse(training.text());
  settings.erase("seed");
  settings["grouping"] = name_of(training.model.grouping);
  for (const char* option :
       {"also", "data", "history", "limit", "plates", "range", "rate", "scaling", "split", "stride"})
    settings[option] = a.text(option);
  if (!a.given("epochs")) settings["epochs"] = "the preset's";
  if (!a.given("learning-rate")) settings["learning_rate"] = "the preset's";
  if (!a.given("rate")) settings["rate"] = "the preset's";
  const std::string path = a.text("out") + "/settings.json";
  if (!fs::exists(path)) return write_file(path, settings.dump(2) + "\n");
  const auto before = parse_json_limited(read_text_file(path, 1 << 20));
  for (const auto& [key, value] : settings.items()) {
    if (before.contains(key) && before[key] == value) continue;
    throw FileError(path, "this sweep began with " + key + " " +
                              (before.contains(key) ? before[key].dump() : "unset") + ", now it is " +
                              value.dump() + "; give the same options, or choose another --out");
  }
}

class Sweep {
 public:
  Sweep(const Arguments& a, SweepTable& table) : a_(a), table_(table) {}

  // Rows that are there are not measured again; a model whose training was cut is trained on.
  void run(const std::vector<GridPoint>& grid) {
    make_directories(a_.text("out") + "/models");
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const std::string label =
          std::to_string(i + 1) + " of " + std::to_string(grid.size()) + " " + grid[i].name();
      if (table_.has(grid[i].name())) continue;
      measure(grid[i], label);
    }
  }

 private:
  void measure(const GridPoint& point, const std::string& label) {
    reset_peak_memory();
    const WindowSet& windows = windows_of(point.model);
    const Split split = make_split(windows, training_split(a_), point.seed);
    const std::vector<std::uint32_t> to_score = windows_to_score(windows, split);
    TrainingSettings settings = training_settings(a_, point.model);
    set_array(settings.model, windows.array());
    settings.seed = point.seed;
    const std::string out = a_.text("out") + "/models/" + point.name() + ".safetensors";
    const std::string state = RunFolder::folder_of(out) + "/last.safetensors";
    a_.note(label);
    TrainingRun training(
        a_, windows, split, settings,
        {.out = out, .force = true, .resume = fs::exists(state) ? state : "", .label = label});
    if (!training.train()) throw Interrupted();
    const SuperTac& model = training.trainer().model();
    const ContactMetrics scores = score(model, windows, to_score, interrupted);
    stop_if_interrupted();
    table_.add(row(point, training, scores));
    fs::remove(state);  // nothing is left to resume
  }

  std::vector<std::uint32_t> windows_to_score(const WindowSet& windows, const Split& split) const {
    constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
    const auto history = static_cast<std::size_t>(a_.integer("history", 0, kMost));
    const auto limit = static_cast<std::size_t>(a_.integer("limit", 0, kMost));
    std::vector<std::uint32_t> chosen;
    for (const std::uint32_t i : split.test)
      if (windows.history(i) >= history) chosen.push_back(i);
    if (chosen.empty())
      throw UsageError("--history " + a_.text("history") + " leaves none of the " +
                       std::to_string(split.test.size()) + " test windows; give a smaller number");
    return limit > 0 ? spread(chosen, limit) : chosen;
  }

  // Sets of other lengths, rates and picture sizes are dropped first: one at a time is in memory.
  const WindowSet& windows_of(const SuperTacSettings& model) {
    if (!windows_ || windows_->timesteps() != model.timesteps || windows_->settings().scale != model.scale ||
        windows_->settings().rate_hz != training_rate_hz(a_, model)) {
      windows_.reset();
      windows_.emplace(training_windows(a_, model));
      a_.note(windows_->counts().summary());
    }
    return *windows_;
  }

  nlohmann::ordered_json row(const GridPoint& point, const TrainingRun& training,
                             const ContactMetrics& scores) const {
    const SuperTac& model = training.trainer().model();
    const SuperTacSettings& s = model.settings();
    const Tensor window = Tensor::full({1, s.timesteps, s.signals()}, real(0.5));
    const Latency latency = measure_latency([&] { model.infer(window); });
    nlohmann::ordered_json row = {{"model", point.name()},
                                  {"preset", s.preset},
                                  {"timesteps", s.timesteps},
                                  {"latent", s.latent},
                                  {"scale", s.scale},
                                  {"channels", s.channels},
                                  {"rcabs", s.rcabs},
                                  {"seed", point.seed},
                                  {"split", a_.text("split")},
                                  {"median_us", latency.median_us},
                                  {"p99_us", latency.p99_us},
                                  {"mmac", cost_of(s).inference * 1e-6},
                                  {"parameters", model.parameter_count()},
                                  {"memory_mb", peak_memory_mb()},
                                  {"train_s", training.folder().seconds()},
                                  {"steps", training.trainer().step()},
                                  {"commit", commit()}};
    for (const auto& [prefix, m] :
         {std::pair<std::string, Metrics>{"", scores.contact()}, {"all_", scores.all()}}) {
      row[prefix + "windows"] = m.windows;
      row[prefix + "ssim"] = m.ssim;
      row[prefix + "psnr_db"] = m.psnr_mean_db;
      row[prefix + "psnr_pooled_db"] = m.psnr_pooled_db;
      row[prefix + "phase"] = m.phase_correlation;
      row[prefix + "phase_floor"] = m.phase_correlation_floor;
      row[prefix + "position_px"] = m.position_error_px;
      row[prefix + "position_mm"] = m.position_error_mm;
    }
    return row;
  }

  const Arguments& a_;
  SweepTable& table_;
  std::optional<WindowSet> windows_;
};

nlohmann::ordered_json describe(const Configuration& c) {
  nlohmann::ordered_json json = {{"configuration", c.name}, {"seeds", c.seeds}, {"models", c.models}};
  for (const SweepColumn& column : sweep_columns())
    if (!column.text && std::string(column.name) != "seed") json[column.name] = c.mean.at(column.name);
  return json;
}

std::string line_of(const Configuration& c) {
  return c.name + ": SSIM " + format(c.mean.at("ssim"), 3) + ", PSNR " + format(c.mean.at("psnr_db"), 1) +
         " dB, " + format(c.mean.at("median_us"), 1) + " us, " + format(c.mean.at("mmac"), 2) + " MMAC, " +
         std::to_string(c.seeds) + " seed(s)";
}

}  // namespace

int run(Arguments& a) {
  const std::string out = a.text("out");
  const std::vector<Condition> conditions =
      a.given("pick") ? conditions_of(a.text("pick")) : std::vector<Condition>{};
  if (!a.given("data") && !fs::exists(out + "/sweep.csv"))
    throw UsageError("--data is needed: there is no " + out + "/sweep.csv to read");
  make_directories(out);
  SweepTable table(out + "/sweep.csv");
  if (table.dropped_a_cut_line()) a.note(out + "/sweep.csv: the last line was cut off and is left out");
  if (a.given("data")) {
    const std::vector<GridPoint> grid = grid_of(a);
    check_settings(a);
    Sweep(a, table).run(grid);
  }
  const std::vector<Configuration> all = configurations(table), front = pareto_front(all);
  if (!draw_chart(out, all)) a.note("gnuplot is not installed: " + out + "/chart.gnuplot waits for it");
  a.print("Pareto front, fastest first:");
  nlohmann::ordered_json result = {{"configurations", all.size()}, {"rows", table.rows().size()}};
  for (const Configuration& c : front) {
    a.print("  " + line_of(c));
    result["front"].push_back(describe(c));
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
      result["pick"] = describe(*best);
    }
  }
  a.write_json(result);
  return code;
}

}  // namespace supertac
