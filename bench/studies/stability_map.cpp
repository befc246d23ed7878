// Where training works: learning rate x beta, several seeds, with and without clipping and warm-up.
//
// Short runs of preset `paper`'s layers on simulated passes; one line of CSV a run. A run whose line is there
// is not repeated, so the program can be interrupted.
#include <cmath>
#include <fstream>
#include <set>

#include "apps/common/command_line/program.h"
#include "apps/common/command_line/version.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "data/recordings/simulator.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

constexpr std::uint64_t kMostBytes = 1 << 24;
constexpr double kTail = 0.1;  // of the steps are averaged for the verdict
constexpr double kLeastExplained = 0.1, kMostWrong = -1;

void declare(Arguments& a) {
  a.required("out", "FILE", "CSV; continued when it exists");
  a.option("learning-rates", "X,...", "peaks of Adam's rate", "0.0003,0.001,0.003,0.01,0.1");
  a.option("betas", "X,...", "weights of the KL divergence", "0.0001,0.001,0.01,0.1,1");
  a.option("safeguards", "on,off", "on: gradient clipped at 1, 5 % warm-up; off: neither", "on,off");
  a.option("seeds", "N", "runs per cell", "5");
  a.option("steps", "N", "of 8 windows", "300");
}

SuperTacSettings network() {
  SuperTacSettings s = SuperTacSettings::of_preset("paper");
  s.timesteps = 32;
  s.scale = 2;
  return s;
}

WindowSet simulated_windows(const SuperTacSettings& model) {
  WindowSettings settings;
  settings.timesteps = static_cast<int>(model.timesteps);
  settings.scale = static_cast<int>(model.scale);
  WindowSet windows(settings);
  for (const char* plate : {"3_Bumps", "4_Ridges", "6_Ridges"}) {
    for (const int pass : {3, 5}) windows.add(simulate_pass(Plate::named(plate), {.pass = pass}));
  }
  return windows;
}

struct Cell {
  bool safeguards;
  double learning_rate, beta;
  std::int64_t seed;
  std::string key() const {
    return std::string(safeguards ? "on" : "off") + "," + format(learning_rate) + "," + format(beta) + "," +
           std::to_string(seed);
  }
};

std::vector<Cell> cells(const Arguments& a) {
  std::vector<Cell> all;
  const std::vector<std::string> words = a.list("safeguards");
  for (const std::string& word : words) {
    if (word != "on" && word != "off") throw UsageError("--safeguards expects on, off or both");
  }
  for (std::int64_t seed = 0; seed < a.integer("seeds", 1, 1000);
       ++seed) {  // outermost: a map half done is a map
    for (const std::string& word : words) {
      for (const double rate : a.numbers("learning-rates", 1e-9, 1)) {
        for (const double beta : a.numbers("betas", 0, 1e6)) all.push_back({word == "on", rate, beta, seed});
      }
    }
  }
  return all;
}

double variance(const WindowSet& windows) {
  const auto pixels = windows.image().pixels();
  std::vector<float> image(pixels);
  double sum = 0, squares = 0, n = 0;
  for (std::size_t i = 0; i < windows.size(); i += 7) {
    windows.truth(i, image);
    for (const float x : image) sum += x, squares += static_cast<double>(x) * x, ++n;
  }
  return squares / n - sum / n * (sum / n);
}

// explained = 1 - L2 / variance of the truth: 1 is perfect, 0 the mean grey, below 0 worse than that.
std::string run_cell(const Cell& cell, const WindowSet& windows, std::int64_t steps, double truth_variance) {
  TrainingSettings s;
  s.model = network();
  s.batch = 8;
  s.learning_rate = cell.learning_rate;
  s.loss.beta = cell.beta;
  s.seed = static_cast<std::uint64_t>(cell.seed);
  if (!cell.safeguards) s.warm_up = s.clip_norm = 0;
  std::vector<std::uint32_t> indices;  // so many that one epoch has the steps asked for
  const auto count = static_cast<std::size_t>(steps * s.batch);
  for (std::size_t i = 0; i < count; ++i)
    indices.push_back(static_cast<std::uint32_t>(i * windows.size() / count));
  s.epochs = 1;
  Trainer trainer(windows, std::move(indices), s);
  double l2 = 0, kld = 0, active = 0, n = 0;
  bool warned = false, collapsed = false;
  std::string outcome;
  try {
    while (!trainer.done() && !interrupted()) {
      const StepReport report = trainer.train_step();
      collapsed = report.collapsed;
      warned |= collapsed;
      if (static_cast<double>(report.step) <= (1 - kTail) * static_cast<double>(steps)) continue;
      l2 += report.l2, kld += report.kld, active += report.active_latents, ++n;
    }
  } catch (const TrainingStopped&) {
    outcome = "stopped";
  }
  stop_if_interrupted();
  const double explained = 1 - l2 / n / truth_variance;
  if (outcome.empty()) {
    outcome = explained >= kLeastExplained ? "trained"
              : explained < kMostWrong     ? "diverged"
              : collapsed                  ? "collapsed"
                                           : "slow";
  }
  const auto cell_text = [&](double value, int digits) {
    return n > 0 ? format(value, digits) : std::string();
  };
  return cell.key() + "," + outcome + "," + std::to_string(trainer.step()) + "," + cell_text(explained, 3) +
         "," + cell_text(kld / n, 4) + "," + cell_text(active / n, 1) + "," + (warned ? "yes" : "no") + "\n";
}

int run(Arguments& a) {
  const std::string out = a.text("out");
  const std::string header =
      "safeguards,learning_rate,beta,seed,outcome,steps,explained,kld,active_latents,warned\n";
  std::string text;
  try {
    text = read_text_file(out, kMostBytes);
  } catch (const FileError&) {  // a new map
    text = "# commit " + std::string(commit()) + "\n" + header;
  }
  const SuperTacSettings model = network();
  const WindowSet windows = simulated_windows(model);
  const double truth_variance = variance(windows);
  const std::vector<Cell> all = cells(a);
  Progress progress(a, "mapping", all.size(), "runs");
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (text.find("\n" + all[i].key() + ",") == std::string::npos) {
      text += run_cell(all[i], windows, a.integer("steps", 10, 1'000'000), truth_variance);
      write_file(out, text);
    }
    progress.update(i + 1);
  }
  return kExitOk;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const supertac::Program program{"stability_map",
                                  "Trains briefly over learning rates and betas and says what became of it.",
                                  supertac::declare, supertac::run};
  return supertac::run_program(program, argc, argv);
}
