// The side of bench/peers/compare.py that runs our code: one order a line on stdin, one answer a line on
// stdout.
//
//   peers_ours MODEL WINDOWS        WINDOWS: safetensors with `windows` [N,T,16]
//   pictures FILE          infers all windows, writes `pictures` [N,S,S]             -> done
//   cost                   -> multiply-adds of inference, of training, per window
//   infer BATCH SECONDS    -> median processor time, median wall time of a call (s), median FMA peak
//   (GFLOP/s) train THREADS SECONDS [BATCH]  the same for a training step of 64 windows, or so many
//   each COUNT FILE        the wall time of so many pictures one by one, `seconds` [COUNT]  -> page faults on
//   the way spin COUNT FILE        the same for additions that take about as long and need no memory
#include <benchmark/benchmark.h>
#include <omp.h>
#include <sys/resource.h>

#include <chrono>
#include <ctime>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>

#include "bench/fma_peak.h"
#include "bench/windows.h"
#include "io/files/safetensors.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"
#include "models/inference/prepared/prepared.h"
#include "models/networks/cost.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

class Ours {
 public:
  Ours(const std::string& model, const std::string& windows)
      : model_(load_model(model).model), prepared_(*model_), windows_(read_windows(windows)) {}

  std::string answer(const std::string& order) {
    std::istringstream words(order);
    std::string what, file;
    int number = 0;
    double seconds = 0;
    words >> what;
    if (what == "pictures" && words >> file) return pictures(file);
    if (what == "cost") {
      const Cost cost = cost_of(model_->settings());
      return format(cost.inference) + " " + format(cost.training);
    }
    if (what == "infer" && words >> number >> seconds && number <= windows_.dim(0)) {
      omp_set_num_threads(1);
      const Tensor batch = first_windows(number);
      return timed(seconds, [&] { prepared_.estimate(batch); });
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
      return each(number, file, [&] { prepared_.estimate(window); });
    }
    if (what == "spin" && words >> number >> file)
      return each(number, file, [] {
        float sum = 0;
        for (int i = 0; i < 75'000; ++i) sum += static_cast<float>(i);
        benchmark::DoNotOptimize(sum);
      });
    throw std::runtime_error("unknown order: " + order);
  }

 private:
  Tensor first_windows(Dim count) const {
    const Dim values = count * model_->settings().timesteps * kTaxels;
    return Tensor::of({count, model_->settings().timesteps, kTaxels},
                      windows_.values().first(static_cast<std::size_t>(values)));
  }

  static Tensor read_windows(const std::string& path) {
    const SafetensorsFile file = SafetensorsFile::read(path);
    const TensorInfo& info = file.tensors().at("windows");
    return Tensor::of({static_cast<Dim>(info.shape.at(0)), static_cast<Dim>(info.shape.at(1)), kTaxels},
                      file.f32("windows"));
  }

  std::string pictures(const std::string& path) {
    const Tensor pictures = prepared_.estimate(windows_).picture;
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
      if (!data_) data_ = std::make_unique<WindowSet>(bench::sliding_bumps(model_->settings()));
      Recipe settings;
      settings.batch = batch;
      settings.model = model_->settings();
      settings.epochs = 100'000;
      trainer = std::make_unique<Trainer>(*data_, bench::all_of(*data_), Objective(*data_, settings));
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
      peak.push_back(bench::fma_gflops());
    }
    return format(median(cpu)) + " " + format(median(wall)) + " " + format(median(peak));
  }

  std::unique_ptr<SuperTac> model_;
  Prepared prepared_;
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
