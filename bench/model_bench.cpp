// Preset `paper` (T 256, LD 10, x4) end to end: inference and a training step.
#include <omp.h>

#include "bench/against_peak.h"
#include "bench/windows.h"
#include "models/inference/prepared/prepared.h"
#include "models/networks/cost.h"
#include "models/training/trainer.h"
#include "tests/allocations.h"

namespace supertac {
namespace {

const SuperTacSettings kPaper = SuperTacSettings::of_preset("paper");

void inference(benchmark::State& state) {
  omp_set_num_threads(1);
  Rng rng(1);
  const SuperTac model(kPaper, rng);
  const Prepared prepared(model);
  const Tensor windows = bench::random_windows(state.range(0), kPaper.timesteps);
  const auto batch = static_cast<double>(state.range(0));
  bench::run_against_peak(state, batch * cost_of(kPaper).inference, [&] { prepared.estimate(windows); });
  state.counters["windows/s"] = batch * 1e6 / state.counters["us"];
}
BENCHMARK(inference)->ArgName("batch")->Arg(1)->Arg(8)->Arg(64)->UseManualTime()->Unit(
    benchmark::kMicrosecond);

// Windows, augmentation, forward, loss, backward, Adam.
void training_step(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  Recipe settings;
  settings.model = kPaper;
  settings.epochs = 100'000;
  settings.augment = kStandardAugmentation;
  const WindowSet windows = bench::sliding_bumps(kPaper);
  Trainer trainer(windows, bench::all_of(windows), Objective(windows, settings));
  for (int i = 0; i < 3; ++i) trainer.train_step();
  const long before = allocations::made;
  for (auto _ : state) trainer.train_step();
  state.counters["allocations/step"] =
      static_cast<double>(allocations::made - before) / static_cast<double>(state.iterations());
  state.SetItemsProcessed(state.iterations() * settings.batch);
}
BENCHMARK(training_step)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace supertac

BENCHMARK_MAIN();
