#include "apps/sweep/sweep.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <limits>
#include <stdexcept>
#include <thread>
#include <utility>

#include "apps/common/command_line/program.h"
#include "apps/common/running/measure.h"
#include "apps/common/running/signals.h"
#include "apps/train/training_options.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "models/inference/evaluation.h"
#include "models/networks/cost.h"

namespace supertac {

namespace fs = std::filesystem;

void declare_measuring(Arguments& a) {
  a.option("limit", "N", "score at most N test windows, evenly spread; 0 = all", "0");
  a.option("history", "N",
           "score only windows with N frames of their pass behind them: with the longest of --timesteps, all "
           "models are judged on the same frames; 0 = all",
           "0");
  a.option("deadline", "S",
           "give up other processes of the sweep when they have written nothing for S seconds", "900");
  a.decides_nothing();
}

Sweep::Sweep(const Arguments& a, SweepTable& table) : a_(a), table_(table) { check_settings(); }

// What all rows of a table have in common: the recordings, and what the options make of the recipes.
void Sweep::check_settings() const {
  nlohmann::ordered_json settings;
  for (const char* option :
       {"augment",         "autoencoder", "batch",         "beta",      "epochs", "grouping",  "history",
        "interval-factor", "lambda",      "learning-rate", "leave-out", "limit",  "optimizer", "plates",
        "random-plates",   "range",       "rate",          "scaling",   "split",  "stride"})
    settings[option] = a_.given(option) || !a_.text(option).empty() ? a_.text(option) : "the preset's";
  settings["last-frame"] = a_.flag("last-frame");
  settings["data"] = hash_of_recordings(a_.text("data"), a_.list("plates"));
  settings["also"] = a_.given("also") ? hash_of_recordings(a_.text("also"), {}) : "";
  const std::string path = a_.text("out") + "/settings.json";
  const FolderLock alone = lock_within(kLongestWriting, a_.text("out"));
  if (!fs::exists(path)) return write_file(path, settings.dump(2) + "\n");
  const auto before = parse_json_limited(read_text_file(path, 1 << 20));
  for (const auto& [key, value] : settings.items()) {
    if (before.contains(key) && before[key] == value) continue;
    throw FileError(path, "this sweep began with " + key + " " +
                              (before.contains(key) ? before[key].dump() : "unset") + ", now it is " +
                              value.dump() + "; give the same options, or choose another --out");
  }
}

// Those of the greatest cost first; equal ones stay in their order.
static std::vector<Recipe> longest_first(std::vector<Recipe> grid) {
  std::ranges::stable_sort(grid, std::greater(), [](const Recipe& r) { return cost_of(r.model).training; });
  return grid;
}

static fs::file_time_type last_write_in(const std::string& folder) {
  auto newest = fs::file_time_type::min();
  std::error_code gone;  // files come and go
  for (fs::recursive_directory_iterator at(folder, gone), end; at != end; at.increment(gone))
    newest = std::max(newest, fs::last_write_time(at->path(), gone));
  return newest;
}

void Sweep::run(const std::vector<Recipe>& grid) {
  make_directories(a_.text("out") + "/models");
  grid_ = grid;
  for (const Recipe& recipe : grid) order_.push_back(model_name_of(recipe));
  const std::vector<Recipe> trainings = longest_first(grid);
  while (!std::ranges::all_of(order_, [&](const auto& name) { return table_.has(name); }))
    if (!take_one(trainings)) wait_for_others();
}

// They hold what is left. A process that is frozen holds its folder too, but writes nothing.
void Sweep::wait_for_others() {
  stop_if_interrupted();
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  table_.read_again();
  const fs::file_time_type newest = last_write_in(a_.text("out") + "/models");
  const auto now = std::chrono::steady_clock::now();
  if (newest != std::exchange(last_write_, newest)) last_seen_ = now;
  const double deadline_s = a_.number("deadline", 1, 1e6);
  if (now - last_seen_ > std::chrono::duration<double>(deadline_s))
    throw std::runtime_error(a_.text("out") +
                             "/models: other processes hold the last trainings and have written "
                             "nothing for " +
                             format(deadline_s) +
                             " s; end those that are frozen, then give the same command again");
}

// Whoever holds the folder of a model's run has the model; a killed process holds nothing.
bool Sweep::take_one(const std::vector<Recipe>& longest_first) {
  for (const Recipe& recipe : longest_first) {
    const std::string name = model_name_of(recipe);
    if (table_.has(name)) continue;
    const std::string folder = RunFolder::folder_of(a_.text("out") + "/models/" + name + ".safetensors");
    make_directories(folder);
    std::optional<FolderLock> mine;
    try {
      mine.emplace(folder);
    } catch (const FileError&) {
      continue;  // another process has it
    }
    table_.read_again();
    if (table_.has(name)) continue;
    const auto number = std::ranges::find(order_, name) - order_.begin() + 1;
    measure(recipe, std::to_string(number) + " of " + std::to_string(order_.size()) + " " + name);
    return true;
  }
  return false;
}

// How many times as long as this training all that no table holds take, by the multiply-adds.
double Sweep::whole_by(const Recipe& recipe) const {
  const auto work = [](const Recipe& r) {
    return cost_of(r.model).training * r.rate_hz * static_cast<double>(r.epochs);
  };
  double all = 0;
  for (const Recipe& r : grid_) all += table_.has(model_name_of(r)) ? 0 : work(r);
  return all / work(recipe);
}

void Sweep::measure(const Recipe& recipe, const std::string& label) {
  reset_peak_memory();
  const std::string out = a_.text("out") + "/models/" + model_name_of(recipe) + ".safetensors";
  const std::string state = RunFolder::folder_of(out) + "/last.safetensors";
  a_.note(label);
  TrainingTask task = window_task(recipe, folders_of(a_));
  const auto windows = task.windows;
  const std::vector<std::uint32_t> to_score = windows_to_score(*windows, task.split);
  a_.note(task.counts);
  TrainingRun training(a_, std::move(task),
                       {.out = out,
                        .force = true,
                        .resume = fs::exists(state) ? state : "",
                        .label = label,
                        .whole = whole_by(recipe)});
  if (!training.train()) throw Interrupted();
  const ZoneMetrics scores =
      score(Ensemble({Prepared(training.trainer().model())}), *windows, to_score, interrupted);
  stop_if_interrupted();
  const nlohmann::ordered_json measured = row(recipe, training, scores);
  {
    const FolderLock alone = lock_within(kLongestWriting, a_.text("out"));
    table_.read_again();
    table_.add(measured, order_);
  }
  fs::remove(state);  // nothing is left to resume
}

std::vector<std::uint32_t> Sweep::windows_to_score(const WindowSet& windows, const Split& split) const {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const auto history = static_cast<std::size_t>(a_.integer("history", 0, kMost));
  const auto limit = static_cast<std::size_t>(a_.integer("limit", 0, kMost));
  std::vector<std::uint32_t> chosen;
  for (const std::uint32_t i : split.test)
    if (windows.history(i) >= history) chosen.push_back(i);
  if (chosen.empty())
    throw UsageError("--history " + a_.text("history") + " leaves none of the " +
                     std::to_string(split.test.size()) + " test windows; give a smaller number");
  return limit > 0 ? evenly_spaced(chosen, limit) : chosen;
}

nlohmann::ordered_json Sweep::row(const Recipe& recipe, const TrainingRun& training,
                                  const ZoneMetrics& scores) const {
  const Network& model = training.trainer().model();
  SuperTacSettings s = recipe.model;
  set_array(s, training.task().windows->array());
  const Tensor window = Tensor::full(model.input_shape(1), real(0.5));
  const Prepared prepared(model);
  const Latency latency = measure_latency([&] { prepared.estimate(window); });
  nlohmann::ordered_json row = {{"model", model_name_of(recipe)},
                                {"preset", s.preset},
                                {"timesteps", s.timesteps},
                                {"latent", s.latent},
                                {"scale", s.scale},
                                {"channels", s.channels},
                                {"rcabs", s.rcabs},
                                {"seed", recipe.seed},
                                {"split", name_of(recipe.split)},
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

}  // namespace supertac
