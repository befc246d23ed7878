// The side of bench/peers/compare.py that runs our code: one order a line on stdin, one answer a line on
// stdout.
//
//   peers_ours MODEL WINDOWS          WINDOWS: safetensors with `windows` [N,T,16]
//   pictures FILE                     infers all windows, writes `pictures` [N,S,S]    -> done
//   infer BATCH SECONDS               -> medians: processor and wall time of a call (s), FMA peak (GFLOP/s)
//   train THREADS SECONDS [BATCH]     the same for a training step of 64 windows, or so many
//   each COUNT FILE                   wall times of pictures one by one, `seconds` [COUNT]  -> page faults
//   spin COUNT FILE                   the same for additions that take as long and need no memory
#include <immintrin.h>
#include <omp.h>
#include <sys/resource.h>

#include <iostream>
#include <map>
#include <memory>
#include <numeric>
#include <sstream>

#include "data/windows/random_passes.h"
#include "io/files/safetensors.h"
#include "io/numbers/clock.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"
#include "models/inference/compiled/compiled_model.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

// Enough independent sums to hide the latency of 4 cycles on two units, few enough for 16 registers.
constexpr int kSums = 12;
constexpr long kSteps = 2000;
volatile float sink;

// Each runs kSteps * kSums operations and returns how many floating-point ones those are.
using Loop = double (*)();

__attribute__((target("avx512f"))) double loop_avx512() {
  __m512 sum[kSums];
  const __m512 factor = _mm512_set1_ps(0.999F);
  for (auto& s : sum) s = factor;
  for (long i = 0; i < kSteps; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < kSums; ++k) sum[k] = _mm512_fmadd_ps(sum[k], factor, factor);
  }
  for (int k = 1; k < kSums; ++k) sum[0] = _mm512_add_ps(sum[0], sum[k]);
  sink = _mm512_cvtss_f32(sum[0]);
  return 2.0 * 16 * kSums * kSteps;
}

__attribute__((target("avx2,fma"))) double loop_avx2() {
  __m256 sum[kSums];
  const __m256 factor = _mm256_set1_ps(0.999F);
  for (auto& s : sum) s = factor;
  for (long i = 0; i < kSteps; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < kSums; ++k) sum[k] = _mm256_fmadd_ps(sum[k], factor, factor);
  }
  for (int k = 1; k < kSums; ++k) sum[0] = _mm256_add_ps(sum[0], sum[k]);
  sink = _mm256_cvtss_f32(sum[0]);
  return 2.0 * 8 * kSums * kSteps;
}

Loop best_loop() {
  if (__builtin_cpu_supports("avx512f")) return loop_avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return loop_avx2;
  throw std::runtime_error("this processor has no AVX2 and FMA, whose peak the benchmarks compare with");
}

// The most multiply-adds that this core can do now, GFLOP/s (two per multiply-add) over about 20 us: a loop
// that touches registers only. The clock of a busy machine changes all the time, so it is measured between
// the things that are compared with it.
double fma_gflops() {
  constexpr int kCalls = 8;
  static const Loop loop = best_loop();
  loop();  // the first wide instructions after a pause run slowly
  double operations = 0;
  const double begin = seconds_of(CLOCK_THREAD_CPUTIME_ID);
  for (int i = 0; i < kCalls; ++i) operations += loop();
  return operations / (seconds_of(CLOCK_THREAD_CPUTIME_ID) - begin) * 1e-9;
}

// Of a finger that slides over simulated plates.
WindowSet simulated_windows(const SuperTacSettings& model) {
  WindowSettings settings;
  settings.timesteps = static_cast<int>(model.timesteps);
  settings.scale = static_cast<int>(model.scale);
  WindowSet windows(settings);
  add_random_passes(windows, {.count = 50});
  return windows;
}

class Ours {
 public:
  Ours(const std::string& model, const std::string& windows)
      : model_(load_model(model).model), compiled_(*model_), windows_(read_windows(windows)) {}

  std::string answer(const std::string& order) {
    std::istringstream words(order);
    std::string what, file;
    int number = 0;
    double seconds = 0;
    words >> what;
    if (what == "pictures" && words >> file) return pictures(file);
    if (what == "infer" && words >> number >> seconds && number <= windows_.dim(0)) {
      omp_set_num_threads(1);
      const Tensor batch = first_windows(number);
      return timed(seconds, [&] { compiled_.estimate(batch); });
    }
    if (what == "train" && words >> number >> seconds) {
      omp_set_num_threads(number);
      int batch = 0;
      if (!(words >> batch)) batch = 64;
      Trainer& of_batch = trainer(batch);
      return timed(seconds, [&] { of_batch.train_step(); });
    }
    if (what == "each" && words >> number >> file) {
      omp_set_num_threads(1);
      const Tensor window = first_windows(1);
      return each(number, file, [&] { compiled_.estimate(window); });
    }
    if (what == "spin" && words >> number >> file)
      return each(number, file, [] {
        float sum = 0;
        for (int i = 0; i < 75'000; ++i) sum += static_cast<float>(i);
        sink = sum;
      });
    throw std::runtime_error("unknown order: " + order);
  }

 private:
  Tensor first_windows(Dim count) const {
    const Dim values = count * model_->settings().timesteps * rig::kTaxels;
    return Tensor::of({count, model_->settings().timesteps, rig::kTaxels},
                      windows_.values().first(static_cast<std::size_t>(values)));
  }

  static Tensor read_windows(const std::string& path) {
    const SafetensorsFile file = SafetensorsFile::read(path);
    const TensorInfo& info = file.tensors().at("windows");
    return Tensor::of({static_cast<Dim>(info.shape.at(0)), static_cast<Dim>(info.shape.at(1)), rig::kTaxels},
                      file.f32("windows"));
  }

  std::string pictures(const std::string& path) {
    const Tensor pictures = compiled_.estimate(windows_).picture;
    const std::span<const Dim> shape = pictures.shape().dims().first(3);  // without the channel
    write_safetensors(path, {},
                      {{"pictures", "F32", {shape.begin(), shape.end()}, std::as_bytes(pictures.values())}});
    return "done";
  }

  Trainer& trainer(int batch) {
    std::unique_ptr<Trainer>& trainer = trainers_[batch];
    if (!trainer) {
      if (!data_) data_ = std::make_unique<WindowSet>(simulated_windows(model_->settings()));
      Recipe settings;
      settings.batch = batch;
      settings.model = model_->settings();
      settings.epochs = 100'000;
      std::vector<std::uint32_t> all(data_->size());
      std::iota(all.begin(), all.end(), 0U);
      trainer = std::make_unique<Trainer>(*data_, std::move(all), settings);
    }
    return *trainer;
  }

  static long page_faults() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt + usage.ru_majflt;
  }

  static double wall() { return seconds_of(CLOCK_MONOTONIC); }

  template <class Work>
  static std::string each(int count, const std::string& path, Work&& work) {
    std::vector<float> seconds(static_cast<std::size_t>(count), 1);  // the pages are there before
    for (int i = 0; i < 100; ++i) work();
    const long before = page_faults();
    for (float& one : seconds) {
      const double begin = wall();
      work();
      one = static_cast<float>(wall() - begin);
    }
    const long faults = page_faults() - before;
    write_safetensors(path, {}, {{"seconds", "F32", {seconds.size()}, std::as_bytes(std::span(seconds))}});
    return std::to_string(faults);
  }

  // Several calls a turn, so that each turn is long beside the resolution of the clocks.
  template <class Work>
  static std::string timed(double seconds, Work&& work) {
    for (int i = 0; i < 3; ++i) work();
    double begin = wall();
    work();
    const int calls = std::max(1, static_cast<int>(1e-3 / (wall() - begin)));
    std::vector<double> cpu, elapsed, peak;
    const double end = wall() + seconds;
    while (wall() < end || cpu.size() < 3) {
      begin = wall();
      const double cpu_begin = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
      for (int i = 0; i < calls; ++i) work();
      cpu.push_back((seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu_begin) / calls);
      elapsed.push_back((wall() - begin) / calls);
      peak.push_back(fma_gflops());
    }
    return format(median(cpu)) + " " + format(median(elapsed)) + " " + format(median(peak));
  }

  std::unique_ptr<SuperTac> model_;
  CompiledModel compiled_;
  Tensor windows_;
  std::unique_ptr<WindowSet> data_;
  std::map<int, std::unique_ptr<Trainer>> trainers_;  // by batch
};

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("expects MODEL and WINDOWS");
  supertac::Ours ours(argv[1], argv[2]);
  for (std::string order; std::getline(std::cin, order);) std::cout << ours.answer(order) << std::endl;
  return 0;
} catch (const std::exception& error) {
  std::cerr << "peers_ours: " << error.what() << '\n';
  return 1;
}
