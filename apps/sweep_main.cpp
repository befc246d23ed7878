// supertac-sweep: a loop over recipes. Each is trained and scored into a row of sweep.csv; chart.html shows
// accuracy against latency.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <span>

#include "apps/common/command_line/program.h"
#include "apps/common/running/measure.h"
#include "apps/common/running/signals.h"
#include "apps/train/training_options.h"
#include "apps/train/training_run.h"
#include "apps/web/chart.h"
#include "apps/web/result_page.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/folder_lock.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/inference/evaluation.h"
#include "models/networks/cost.h"

namespace supertac {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void declare(Arguments& a) {
  a.required("out", "DIR", "sweep.csv, chart.html and models; a sweep that was stopped goes on where it was")
      .writes();
  a.required("data", "DIR", "recordings to train and test on");
  // The axes of the grid, which may grow: a row of the table says where on them it stands.
  a.option("preset", "A,B,...", "recipes to start from: paper, tiny, frame", "paper").decides_nothing();
  a.option("timesteps", "T,...",
           "samples per window, multiples of 16, 32 to 512, or 1 (default: the preset's)")
      .decides_nothing();
  a.option("latent", "LD,...", "latent numbers per group of taxels (default: the preset's)")
      .decides_nothing();
  a.option("scale", "N,...", "pictures N times as fine as the array: 2, 4, 8, 16 (default: the preset's)")
      .decides_nothing();
  a.option("seeds", "N,...", "of split, initial weights, order, noise", "0").decides_nothing();
  declare_training(a);
  declare_window_training(a);
  a.more().option("limit", "N", "score at most N test windows, evenly spread; 0 = all", "0");
  a.option("history", "N",
           "score only windows with N frames of their pass behind them: with the longest of --timesteps, all "
           "models are judged on the same frames; 0 = all",
           "0");
}

namespace {

// Settings of the network: their names, and in the name of a model. The first three are options.
struct Axis {
  const char* name;
  Dim SuperTacSettings::*setting;
  const char* letter;
};
constexpr Axis kAxes[] = {{"timesteps", &SuperTacSettings::timesteps, "_t"},
                          {"latent", &SuperTacSettings::latent, "_l"},
                          {"scale", &SuperTacSettings::scale, "_x"},
                          {"channels", &SuperTacSettings::channels, "_c"},
                          {"rcabs", &SuperTacSettings::rcabs, "_r"}};

// What was left out, as it may stand in a file's name and in a cell.
std::string left_out_of(const Recipe& recipe) {
  std::string text = joined(recipe.leave_out, "_");
  for (char& c : text)
    if (std::string_view(",/\"\\\n").find(c) != std::string_view::npos) c = '-';
  return text;
}
// "paper_t256_l10_x4_c32_r3_s0", and what was left out.
std::string model_name_of(const Recipe& recipe) {
  std::string name = recipe.model.preset;
  for (const Axis& axis : kAxes) name += axis.letter + std::to_string(recipe.model.*axis.setting);
  const std::string left_out = left_out_of(recipe);
  return name + "_s" + std::to_string(recipe.seed) + (left_out.empty() ? "" : "_" + left_out);
}

// What can be left out of the recordings, each once: their groups, or their plates.
std::vector<std::string> each_of(const Arguments& a, SplitKind split) {
  std::set<std::string> names;
  for (const std::string& path : list_recordings(a.text("data")))
    names.insert(
        value_or(SafetensorsFile::read(path).metadata(), split == SplitKind::group ? "group" : "plate"));
  if (names.erase("") > 0)
    throw UsageError("--leave-out each: a recording in " + a.text("data") + " names no group");
  return {names.begin(), names.end()};
}

std::vector<Dim> whole_numbers(const Arguments& a, const std::string& name) {
  std::vector<Dim> all;
  for (const double value : a.numbers(name, 0, 1e9)) {
    all.push_back(static_cast<Dim>(value));
    if (static_cast<double>(all.back()) != value)
      throw UsageError("--" + name + " expects whole numbers, found " + a.text(name));
  }
  return all;
}

// What supertac-train would train with each combination; seeds change fastest.
std::vector<Recipe> grid_of(const Arguments& a) {
  std::vector<Recipe> grid;
  for (const std::string& preset : a.list("preset"))
    grid.push_back(as_usage([&] { return recipe_of(a, Recipe::named(preset)); }));
  for (const Axis& axis : std::span(kAxes).first(3)) {
    if (!a.given(axis.name)) continue;
    std::vector<Recipe> finer;
    for (Recipe& recipe : grid)
      for (const Dim value : whole_numbers(a, axis.name))
        recipe.model.*axis.setting = value, finer.push_back(recipe);
    grid = finer;
  }
  std::vector<Recipe> all;
  std::vector<std::vector<std::string>> leave_out;  // one after the other, of every recipe
  for (Recipe& recipe : grid) {
    as_usage([&] { recipe.check(); });
    if (leave_out.empty() && a.text("leave-out") == "each")
      for (const std::string& one : each_of(a, recipe.split)) leave_out.push_back({one});
    if (leave_out.empty()) leave_out = {recipe.leave_out};
    for (const std::vector<std::string>& left_out : leave_out)
      for (const Dim seed : whole_numbers(a, "seeds"))
        recipe.seed = static_cast<std::uint64_t>(seed), recipe.leave_out = left_out, all.push_back(recipe);
  }
  if (all.empty()) throw UsageError("the grid is empty: give --preset and --seeds at least one value");
  return all;
}

// Figures that cannot be compared do not mix: whatever a table's rows have in common has to stay.
void check_settings(const Arguments& a) {
  const std::string path = a.text("out") + "/settings.json";
  const Json settings = {{"command", a.deciding_options()},
                         {"data", hash_of_recordings(a.text("data"), a.list("plates"))}};
  const std::string now = settings.dump(2) + "\n";
  if (!fs::exists(path)) return write_file(path, now);
  const std::string before = read_text_file(path, 1 << 20);
  if (before != now)
    throw FileError(path, "this sweep began with " + before + ", now it is " + now +
                              "; give the same options, or choose another --out");
}

// sweep.csv: one row for each model.
constexpr const char* kColumns =
    "model,preset,timesteps,latent,scale,channels,rcabs,seed,split,left_out,windows,ssim,psnr_db,phase,"
    "phase_floor,position_mm,all_windows,all_ssim,all_psnr_db,all_phase,all_phase_floor,all_position_mm,"
    "median_us,p99_us,mmac,parameters,train_s,steps,commit";

struct Measured {
  std::string model, left_out;
  double ssim, median_us;  // NaN for a figure over no windows
  // What stands before "_s0": the same for all seeds, and for all that was left out.
  std::string configuration() const {
    return model.substr(0, model.rfind("_s", model.size() - left_out.size() - 2));
  }
};

class Table {
 public:
  explicit Table(std::string path) : path_(std::move(path)) {
    if (!fs::exists(path_)) {
      rows_.push_back(comma_list(kColumns));
      return;
    }
    const std::string content = read_text_file(path_, 64 << 20);
    std::size_t end = 0;
    for (std::size_t begin = 0; (end = content.find('\n', begin)) != std::string::npos; begin = end + 1) {
      rows_.push_back(comma_list(content.substr(begin, end - begin)));
      if (rows_.front() != comma_list(kColumns) || rows_.back().size() != rows_.front().size())
        throw FileError(path_, "line " + std::to_string(rows_.size()) + ": expected the columns " + kColumns +
                                   "; correct or remove the line, or choose another --out");
    }
  }
  bool has(const std::string& model) const {
    return std::ranges::any_of(rows_, [&](const auto& row) { return row.front() == model; });
  }
  void add(const Json& values) {
    std::vector<std::string> cells;
    for (const std::string& name : rows_.front()) {
      const Json& value = values.at(name);
      cells.push_back(value.is_string()         ? value.get<std::string>()
                      : value.is_number_float() ? format(value.get<double>(), 6)
                                                : value.dump());
    }
    rows_.push_back(cells);
    std::string content;
    for (const auto& row : rows_) content += joined(row) + "\n";
    write_file(path_, content);
  }
  std::vector<Measured> measured() const {
    std::vector<Measured> all;
    for (const auto& row : std::span(rows_).subspan(1)) {
      const auto cell = [&](const char* column) {
        return row.at(static_cast<std::size_t>(std::ranges::find(rows_[0], column) - rows_[0].begin()));
      };
      const auto number = [&](const char* column) { return parse_double(cell(column)).value_or(NAN); };
      all.push_back({cell("model"), cell("left_out"), number("ssim"), number("median_us")});
    }
    return all;
  }

 private:
  std::string path_;
  std::vector<std::vector<std::string>> rows_;
};

std::vector<std::uint32_t> windows_to_score(const Arguments& a, const WindowSet& windows,
                                            const Split& split) {
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const auto history = static_cast<std::size_t>(a.integer("history", 0, kMost));
  const auto limit = static_cast<std::size_t>(a.integer("limit", 0, kMost));
  std::vector<std::uint32_t> chosen;
  for (const std::uint32_t i : split.test)
    if (windows.history(i) >= history) chosen.push_back(i);
  if (chosen.empty())
    throw UsageError("--history " + a.text("history") + " leaves none of the " +
                     std::to_string(split.test.size()) + " test windows; give a smaller number");
  return limit > 0 ? evenly_spaced(chosen, limit) : chosen;
}

Json row_of(const Recipe& recipe, const TrainingRun& training, const ZoneMetrics& scores) {
  const SuperTac& model = training.trainer().model();
  SuperTacSettings s = recipe.model;
  set_array(s, training.task().windows->array());
  const Tensor window = Tensor::full(model.input_shape(1), real(0.5));
  const CompiledModel compiled(model);
  const Latency latency = measure_latency([&] { compiled.estimate(window); });
  Json row = {{"model", model_name_of(recipe)}, {"preset", s.preset}};
  for (const Axis& axis : kAxes) row[axis.name] = s.*axis.setting;
  row["seed"] = recipe.seed;
  row["split"] = name_of(recipe.split);
  row["left_out"] = left_out_of(recipe);
  for (const auto& [prefix, m] :
       {std::pair<std::string, Metrics>{"", scores.contact()}, {"all_", scores.all()}}) {
    row[prefix + "windows"] = m.windows;
    row[prefix + "ssim"] = m.ssim;
    row[prefix + "psnr_db"] = m.psnr_mean_db;
    row[prefix + "phase"] = m.phase_correlation;
    row[prefix + "phase_floor"] = m.phase_correlation_floor;
    row[prefix + "position_mm"] = m.position_error_mm;
  }
  row.update({{"median_us", latency.median_us},
              {"p99_us", latency.p99_us},
              {"mmac", cost_of(s).inference * 1e-6},
              {"parameters", model.parameter_count()},
              {"train_s", training.folder().seconds()},
              {"steps", training.trainer().step()},
              {"commit", commit()}});
  return row;
}

// A model whose training was cut is trained on.
Json measure(const Arguments& a, const Recipe& recipe, const std::string& label) {
  const std::string out = a.text("out") + "/models/" + model_name_of(recipe) + ".safetensors";
  const std::string state = RunFolder::folder_of(out) + "/last.safetensors";
  a.note(label);
  TrainingTask task = window_task(recipe, folders_of(a));
  const auto windows = task.windows;
  const std::vector<std::uint32_t> to_score = windows_to_score(a, *windows, task.split);
  a.note(task.counts);
  TrainingRun training(a, std::move(task),
                       {.out = out, .force = true, .resume = fs::exists(state) ? state : "", .label = label});
  if (!training.train()) throw Interrupted();
  const ZoneMetrics scores =
      score(Ensemble({CompiledModel(training.trainer().model())}), *windows, to_score, interrupted);
  stop_if_interrupted();
  const Json row = row_of(recipe, training, scores);
  fs::remove(state);  // nothing is left to resume
  return row;
}

// The means over the seeds of one configuration, and over what was left out.
struct Configuration {
  std::string name;
  std::size_t seeds = 0;
  double ssim = 0, median_us = 0;
  bool on_front = false;  // no other is both faster and more accurate
};

// Fastest first.
std::vector<Configuration> configurations(const std::vector<Measured>& models) {
  std::vector<Configuration> all;
  for (const Measured& m : models) {
    auto at = std::ranges::find(all, m.configuration(), &Configuration::name);
    if (at == all.end()) at = all.insert(at, {m.configuration()});
    at->ssim += m.ssim, at->median_us += m.median_us, ++at->seeds;
  }
  for (Configuration& c : all)
    c.ssim /= static_cast<double>(c.seeds), c.median_us /= static_cast<double>(c.seeds);
  std::ranges::stable_sort(all, {}, &Configuration::median_us);
  double best = -INFINITY;
  for (Configuration& c : all)
    if (c.ssim > best) c.on_front = true, best = c.ssim;
  return all;
}

// Models of which something was left out and tested, the worst first; empty where nothing was.
std::vector<Measured> left_out_models(std::vector<Measured> models) {
  std::erase_if(models, [](const Measured& m) { return m.left_out.empty(); });
  std::ranges::stable_sort(models, {}, [](const Measured& m) { return std::isnan(m.ssim) ? -1 : m.ssim; });
  return models;
}

// Points are labelled by the numbers of the table below.
std::string page_of(const std::vector<Configuration>& all, const std::vector<Measured>& left_out,
                    const Arguments& a) {
  ChartSeries front{.name = "Pareto front", .points = {}, .line = true, .dots = true};
  ChartSeries others{.name = "dominated", .points = {}, .line = false, .dots = true};
  std::string rows;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Configuration& c = all[i];
    ChartSeries& series = c.on_front ? front : others;
    series.points.emplace_back(c.median_us, c.ssim);
    series.labels.push_back(std::to_string(i + 1));
    rows += std::string(c.on_front ? "<tr class=\"own\">" : "<tr>") + "<td>" + std::to_string(i + 1) +
            "&ensp;" + escaped(c.name) + "</td><td>" + std::to_string(c.seeds) + "</td><td>" +
            format(c.median_us, 1) + "</td><td>" + format(c.ssim, 3) + "</td></tr>";
  }
  std::string unseen;
  for (const Measured& m : left_out)
    unseen += "<tr><td>" + escaped(m.model) + "</td><td>" + format(m.ssim, 3) + "</td></tr>";
  if (!unseen.empty())
    unseen = page_section("Each left out in turn", "the worst first: tested on what it has not seen",
                          page_table({"model, and what it has not seen", "contact SSIM"}, unseen));
  return result_page(
      "SuperTac sweep",
      page_section(
          "Accuracy against the time of a picture",
          "processor time at batch 1 on one thread; SSIM of contact windows, mean over models; bold: of the "
          "Pareto front, no other is both faster and more accurate",
          chart_svg("Contact SSIM", {.label = "one picture, us", .logarithmic = true},
                    {.label = "SSIM", .most = 1}, {front, others}) +
              page_table({"configuration", "models", "one picture, us", "contact SSIM"}, rows)) +
          unseen +
          page_section("What made this page", "",
                       page_facts({{"command", a.command_line()}, {"commit", commit()}})));
}

}  // namespace

int run(Arguments& a) {
  const std::string out = a.text("out");
  const std::vector<Recipe> grid = grid_of(a);
  make_directories(out + "/models");
  const FolderLock alone(out);
  Table table(out + "/sweep.csv");
  check_settings(a);
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const std::string name = model_name_of(grid[i]);
    if (!table.has(name))
      table.add(
          measure(a, grid[i], std::to_string(i + 1) + " of " + std::to_string(grid.size()) + " " + name));
  }
  const std::vector<Configuration> all = configurations(table.measured());
  const std::vector<Measured> left_out = left_out_models(table.measured());
  write_file(out + "/chart.html", page_of(all, left_out, a));
  a.print("Pareto front, fastest first:");
  Json result = {{"configurations", all.size()}};
  for (const Configuration& c : all) {
    if (!c.on_front) continue;
    a.print("  " + c.name + ": SSIM " + format(c.ssim, 3) + ", " + format(c.median_us, 1) + " us, " +
            std::to_string(c.seeds) + " model(s)");
    result["front"].push_back(
        {{"configuration", c.name}, {"seeds", c.seeds}, {"ssim", c.ssim}, {"median_us", c.median_us}});
  }
  if (!left_out.empty()) a.print("Each left out in turn, the worst first:");
  for (const Measured& m : left_out) {
    a.print("  " + m.model + ": SSIM " + format(m.ssim, 3));
    result["left_out"].push_back({{"model", m.model}, {"ssim", m.ssim}});
  }
  a.write_json(result);
  return kExitOk;
}

}  // namespace supertac
