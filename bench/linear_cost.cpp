// How the cost grows: processor time (one thread) of a window against its length, of a batch against its
// size, of a window against the width of the upsampler, of training against the number of windows. Preset
// `paper` elsewhere. Prints CSV; bench/linear_cost.gp draws it and states the slopes.
#include <omp.h>

#include <cstdio>
#include <functional>
#include <iostream>
#include <memory>

#include "bench/fma_peak.h"
#include "bench/windows.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "models/networks/cost.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

struct Point {
  const char* axis;
  Dim value;
  double mmac;  // of one run
  std::function<void()> run;
  std::vector<double> seconds{};
};

Point inference(const char* axis, Dim value, const SuperTacSettings& settings, Dim batch) {
  Rng rng(1);
  const auto model = std::make_shared<SuperTac>(settings, rng);
  const auto windows = std::make_shared<Tensor>(bench::random_windows(batch, settings.timesteps));
  return {axis, value, 1e-6 * static_cast<double>(batch) * cost_of(settings).inference,
          [=] { model->infer(*windows); }};
}

Point training(Dim count) {
  TrainingSettings settings;
  settings.model = SuperTacSettings::of_preset("paper");
  settings.epochs = 1;
  const auto windows = std::make_shared<WindowSet>(bench::sliding_bumps(settings.model));
  std::vector<std::uint32_t> chosen = bench::all_of(*windows);
  chosen.resize(static_cast<std::size_t>(count));
  return {"training_windows", count, 1e-6 * static_cast<double>(count) * cost_of(settings.model).training,
          [=] {
            Trainer trainer(*windows, chosen, settings);
            while (!trainer.done()) trainer.train_step();
          }};
}

std::vector<Point> points() {
  const SuperTacSettings paper = SuperTacSettings::of_preset("paper");
  std::vector<Point> all;
  for (const Dim t : {32, 64, 128, 192, 256, 320, 384, 448, 512}) {
    SuperTacSettings s = paper;
    s.timesteps = t;
    all.push_back(inference("timesteps", t, s, 1));
  }
  for (const Dim n : {1, 2, 4, 8, 16, 32, 64, 128, 256}) all.push_back(inference("batch", n, paper, n));
  for (const Dim c : {8, 16, 32, 48, 64, 80, 96}) {
    SuperTacSettings s = paper;
    s.channels = c;
    all.push_back(inference("channels", c, s, 1));
  }
  for (const Dim n : {512, 1024, 2048, 4096}) all.push_back(training(n));
  return all;
}

// Rounds over all points, so that a slow spell of the machine does not fall on one of them.
void measure(std::vector<Point>& all) {
  constexpr int kRounds = 7;
  constexpr double kTurn = 5e-3;
  for (Point& p : all) p.run();
  for (int round = 0; round < kRounds; ++round) {
    for (Point& p : all) {
      if (std::string(p.axis) == "training_windows" && round >= 3) continue;
      int runs = 0;
      const double begin = bench::cpu_seconds();
      do {
        p.run();
        ++runs;
      } while (bench::cpu_seconds() - begin < kTurn);
      p.seconds.push_back((bench::cpu_seconds() - begin) / runs);
    }
  }
}

}  // namespace
}  // namespace supertac

int main() {
  using namespace supertac;
  omp_set_num_threads(1);
  std::vector<Point> all = points();
  measure(all);
  std::cout << "axis,value,mmac,us\n";
  for (Point& p : all)
    std::cout << p.axis << ',' << p.value << ',' << format(p.mmac, 4) << ','
              << format(1e6 * median(p.seconds), 2) << '\n';
}
