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

#include <chrono>
#include <ctime>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>

#include "data/windows/windows.h"
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

// A pass of 6,000 frames of a finger sliding over bumps.
WindowSet sliding_bumps(const SuperTacSettings& model) {
  WindowSettings settings;
  settings.timesteps = static_cast<int>(model.timesteps);
  settings.scale = static_cast<int>(model.scale);
  WindowSet windows(settings);
  const Plate plate = Plate::named("3_Bumps");
  Recording r;
  r.plate = "3_Bumps";
  r.trial = r.pass = 1;
  r.speed_mm_s = 2.5;
  r.source = "simulated";
  for (int i = 0; i < 6000; ++i) {
    const double time = i / 300.0, y = 28 + r.speed_mm_s * time;
    r.time_s.push_back(time);
    r.position_mm.insert(r.position_mm.end(), {18, static_cast<float>(y)});
    for (int k = 0; k < rig::kTaxels; ++k)
      r.signals.push_back(static_cast<float>(2.44 - 0.1 * plate.height(18, y - 4.5 + 3 * (k / 4))));
  }
  windows.add(r);
  return windows;
}

std::vector<std::uint32_t> all_of(const WindowSet& windows) {
  std::vector<std::uint32_t> indices(windows.size());
  for (std::uint32_t i = 0; i < windows.size(); ++i) indices[i] = i;
  return indices;
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
    const auto height = static_cast<std::uint64_t>(model_->settings().image_height());
    const auto width = static_cast<std::uint64_t>(model_->settings().image_width());
    write_safetensors(path, {},
                      {{"pictures",
                        "F32",
                        {static_cast<std::uint64_t>(windows_.dim(0)), height, width},
                        std::as_bytes(pictures.values())}});
    return "done";
  }

  Trainer& trainer(int batch) {
    std::unique_ptr<Trainer>& trainer = trainers_[batch];
    if (!trainer) {
      if (!data_) data_ = std::make_unique<WindowSet>(sliding_bumps(model_->settings()));
      Recipe settings;
      settings.batch = batch;
      settings.model = model_->settings();
      settings.epochs = 100'000;
      trainer = std::make_unique<Trainer>(*data_, all_of(*data_), Objective(*data_, settings));
    }
    return *trainer;
  }

  static long page_faults() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt + usage.ru_majflt;
  }

  template <class Work>
  static std::string each(int count, const std::string& path, Work&& work) {
    using Clock = std::chrono::steady_clock;
    std::vector<float> seconds(static_cast<std::size_t>(count), 1);  // the pages are there before
    for (int i = 0; i < 100; ++i) work();
    const long before = page_faults();
    for (float& one : seconds) {
      const Clock::time_point begin = Clock::now();
      work();
      one = std::chrono::duration<float>(Clock::now() - begin).count();
    }
    const long faults = page_faults() - before;
    write_safetensors(path, {}, {{"seconds", "F32", {seconds.size()}, std::as_bytes(std::span(seconds))}});
    return std::to_string(faults);
  }

  template <class Work>
  static std::string timed(double seconds, Work&& work) {
    using Clock = std::chrono::steady_clock;
    const auto process_seconds = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
    const auto since = [](Clock::time_point t) {
      return std::chrono::duration<double>(Clock::now() - t).count();
    };
    for (int i = 0; i < 3; ++i) work();
    // clock() counts microseconds: several calls a turn.
    Clock::time_point begin = Clock::now();
    work();
    const int calls = std::max(1, static_cast<int>(1e-3 / since(begin)));
    std::vector<double> cpu, wall, peak;
    const Clock::time_point start = Clock::now();
    while (since(start) < seconds || cpu.size() < 3) {
      begin = Clock::now();
      const double cpu_begin = process_seconds();
      for (int i = 0; i < calls; ++i) work();
      cpu.push_back((process_seconds() - cpu_begin) / calls);
      wall.push_back(since(begin) / calls);
      peak.push_back(fma_gflops());
    }
    return format(median(cpu)) + " " + format(median(wall)) + " " + format(median(peak));
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
