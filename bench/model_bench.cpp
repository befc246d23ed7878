// Preset `paper` (T 256, LD 10, x4) end to end: inference, a training step, start-up, data loading.
#include <omp.h>

#include <filesystem>

#include "bench/against_peak.h"
#include "bench/windows.h"
#include "data/windows/signal_features.h"
#include "models/files/model_file.h"
#include "models/inference/novelty.h"
#include "models/inference/prepared.h"
#include "models/networks/cost.h"
#include "models/training/trainer.h"
#include "tests/allocations.h"

namespace supertac {
namespace {

const SuperTacSettings kPaper = SuperTacSettings::of_preset("paper");

double counted_since(long before, const benchmark::State& state) {
  return static_cast<double>(allocations::made - before) /
         static_cast<double>(std::max<std::int64_t>(1, state.iterations()));
}

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

// What the intervals cost: the same network without its second plane.
void without_interval(benchmark::State& state) {
  omp_set_num_threads(1);
  SuperTacSettings settings = kPaper;
  settings.spread = false;
  Rng rng(1);
  const SuperTac model(settings, rng);
  const Prepared prepared(model);
  const Tensor windows = bench::random_windows(state.range(0), settings.timesteps);
  bench::run_against_peak(state, static_cast<double>(state.range(0)) * cost_of(settings).inference,
                          [&] { prepared.estimate(windows); });
}
BENCHMARK(without_interval)
    ->ArgName("batch")
    ->Arg(1)
    ->Arg(64)
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

// What the alarm costs a window.
void alarm(benchmark::State& state) {
  const TaxelArray array;
  const auto count = static_cast<Dim>(signal_feature_count(array));
  Rng rng(1);
  Tensor of_training(Shape{10 * count, count});
  for (real& x : of_training.values()) x = rng.uniform(1.0);
  const Novelty novelty(of_training);
  const Tensor window = bench::random_windows(1, kPaper.timesteps);
  std::vector<float> features(static_cast<std::size_t>(count));
  for (auto _ : state) {
    signal_features(window.values(), array, features);
    benchmark::DoNotOptimize(novelty.unlike_training(features));
  }
}
BENCHMARK(alarm)->Unit(benchmark::kMicrosecond);

// Windows, augmentation, forward, loss, backward, Adam.
void training_step(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  TrainingSettings settings;
  settings.model = kPaper;
  settings.epochs = 100'000;
  settings.augment = kStandardAugmentation;
  const WindowSet windows = bench::sliding_bumps(kPaper);
  Trainer trainer(windows, bench::all_of(windows), settings);
  for (int i = 0; i < 3; ++i) trainer.train_step();
  const long before = allocations::made;
  for (auto _ : state) trainer.train_step();
  state.counters["allocations/step"] = counted_since(before, state);
  state.SetItemsProcessed(state.iterations() * settings.batch);
}
BENCHMARK(training_step)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

// From a model file to the first picture.
void first_picture(benchmark::State& state) {
  omp_set_num_threads(1);
  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / "supertac_model_bench.safetensors";
  Rng rng(1);
  save_model(path, SuperTac(kPaper, rng), {}, {});
  const Tensor window = bench::random_windows(1, kPaper.timesteps);
  for (auto _ : state) benchmark::DoNotOptimize(load_model(path.string()).model->infer(window));
  std::filesystem::remove(path);
}
BENCHMARK(first_picture)->Unit(benchmark::kMillisecond);

// What a training step asks of the data: the batch's indices, windows, augmentation and truths.
void data_loading(benchmark::State& state) {
  const WindowSet windows = bench::sliding_bumps(kPaper);
  const Batching batching(bench::all_of(windows), 64, 0);
  const bool augmented = state.range(0) != 0;
  const AugmentSettings augmentation = kStandardAugmentation;
  std::vector<std::uint32_t> indices(64);
  std::vector<float> window(static_cast<std::size_t>(kPaper.timesteps * kTaxels));
  std::vector<float> truth(static_cast<std::size_t>(kPaper.image_height() * kPaper.image_width()));
  std::uint64_t step = 0;
  for (auto _ : state) {
    batching.batch(0, step++ % batching.batches_per_epoch(), indices);
    for (const std::uint32_t i : indices) {
      windows.window(i, window);
      if (augmented) augment(augmentation, 0, i, window);
      windows.truth(i, truth);
      benchmark::ClobberMemory();
    }
  }
  state.SetItemsProcessed(state.iterations() * 64);
}
BENCHMARK(data_loading)->ArgName("augmented")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace supertac

BENCHMARK_MAIN();
