#include "apps/sweep/sweep.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <thread>
#include <utility>

#include "apps/common/command_line/version.h"
#include "apps/common/running/measure.h"
#include "apps/common/running/signals.h"
#include "apps/sweep/shards.h"
#include "apps/train/training_options.h"
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

// What all rows of a table have in common.
void Sweep::check_settings() const {
  const TrainingSettings training = training_settings(a_, {});
  nlohmann::ordered_json settings = to_json(training);
  settings.erase("seed");
  settings["grouping"] = name_of(training.model.grouping);
  for (const char* option : {"also", "data", "history", "leave-out", "limit", "plates", "random-plates",
                             "range", "rate", "scaling", "split", "stride"})
    settings[option] = a_.text(option);
  for (const auto& [option, key] :
       {std::pair("epochs", "epochs"), {"learning-rate", "learning_rate"}, {"rate", "rate"}})
    if (!a_.given(option)) settings[key] = "the preset's";
  if (a_.given("shard")) settings[kShardKey] = a_.text("shard"), settings[kGridKey] = names_of(grid_of(a_));
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

std::vector<GridPoint> longest_first(std::vector<GridPoint> grid) {
  std::stable_sort(grid.begin(), grid.end(), [](const GridPoint& a, const GridPoint& b) {
    return cost_of(a.model).training > cost_of(b.model).training;
  });
  return grid;
}

static fs::file_time_type last_write_in(const std::string& folder) {
  auto newest = fs::file_time_type::min();
  std::error_code gone;  // files come and go
  for (fs::recursive_directory_iterator at(folder, gone), end; at != end; at.increment(gone))
    newest = std::max(newest, fs::last_write_time(at->path(), gone));
  return newest;
}

void Sweep::run(const std::vector<GridPoint>& grid) {
  make_directories(a_.text("out") + "/models");
  order_ = names_of(grid);
  const std::vector<GridPoint> trainings = longest_first(grid);
  const auto done = [&] {
    return std::all_of(order_.begin(), order_.end(), [&](const auto& name) { return table_.has(name); });
  };
  while (!done()) {
    if (!take_one(trainings)) wait_for_others();
  }
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
bool Sweep::take_one(const std::vector<GridPoint>& longest_first) {
  for (const GridPoint& point : longest_first) {
    if (table_.has(point.name())) continue;
    const std::string folder =
        RunFolder::folder_of(a_.text("out") + "/models/" + point.name() + ".safetensors");
    make_directories(folder);
    std::optional<FolderLock> mine;
    try {
      mine.emplace(folder);
    } catch (const FileError&) {
      continue;  // another process has it
    }
    table_.read_again();
    if (table_.has(point.name())) continue;
    const auto number = std::find(order_.begin(), order_.end(), point.name()) - order_.begin() + 1;
    measure(point, std::to_string(number) + " of " + std::to_string(order_.size()) + " " + point.name());
    return true;
  }
  return false;
}

// How many times as long as this point's training all that no table holds takes, by the multiply-adds.
double Sweep::whole_by(const GridPoint& point) const {
  const auto work = [&](const GridPoint& p) {
    return cost_of(p.model).training * training_rate_hz(a_, p.model) *
           static_cast<double>(training_settings(a_, p.model).epochs);
  };
  double all = 0;
  for (const GridPoint& p : shard_of(a_, grid_of(a_))) all += table_.has(p.name()) ? 0 : work(p);
  return all / work(point);
}

void Sweep::measure(const GridPoint& point, const std::string& label) {
  reset_peak_memory();
  const WindowSet& windows = windows_of(point.model);
  TrainingSettings settings = training_settings(a_, point.model);
  set_array(settings.model, windows.array());
  settings.seed = point.seed;
  const std::string out = a_.text("out") + "/models/" + point.name() + ".safetensors";
  const std::string state = RunFolder::folder_of(out) + "/last.safetensors";
  a_.note(label);
  TrainingTask task = window_task(a_, windows, settings);
  const std::vector<std::uint32_t> to_score = windows_to_score(windows, task.split);
  TrainingRun training(a_, std::move(task),
                       {.out = out,
                        .force = true,
                        .resume = fs::exists(state) ? state : "",
                        .label = label,
                        .whole = whole_by(point)});
  if (!training.train()) throw Interrupted();
  const ZoneMetrics scores =
      score(Ensemble({Prepared(training.trainer().model())}), windows, to_score, interrupted);
  stop_if_interrupted();
  const nlohmann::ordered_json measured = row(point, training, scores);
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
  return limit > 0 ? spread(chosen, limit) : chosen;
}

// Sets of other lengths, rates and picture sizes are dropped first: one at a time is in memory.
const WindowSet& Sweep::windows_of(const SuperTacSettings& model) {
  if (!windows_ || windows_->timesteps() != model.timesteps || windows_->settings().scale != model.scale ||
      windows_->settings().rate_hz != training_rate_hz(a_, model)) {
    windows_.reset();
    windows_.emplace(training_windows(a_, model, 0));  // all seeds share them
    a_.note(windows_->counts().summary());
  }
  return *windows_;
}

nlohmann::ordered_json Sweep::row(const GridPoint& point, const TrainingRun& training,
                                  const ZoneMetrics& scores) const {
  const Network& model = training.trainer().model();
  SuperTacSettings s = point.model;
  set_array(s, windows_->array());
  const Tensor window = Tensor::full(model.input_shape(1), real(0.5));
  const Prepared prepared(model);
  const Latency latency = measure_latency([&] { prepared.estimate(window); });
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

}  // namespace supertac
