// How long the machine itself stood still: a study that measures milliseconds on a loaded or virtual machine
// must know. One thread per processor sleeps a millisecond at a time and notes when it was woken late.
#pragma once

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "hardware/ports/serial_port.h"

namespace supertac {

class StallWatch {
 public:
  StallWatch() {
    due_.resize(std::max(1U, std::thread::hardware_concurrency()), monotonic_seconds());
    for (unsigned cpu = 0; cpu < due_.size(); ++cpu) threads_.emplace_back([this, cpu] { run(cpu); });
  }
  ~StallWatch() {
    stop_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

  /// Seconds between two times of the wall for which some processor did not wake a sleeper, at worst.
  double longest(double from, double until) {
    const std::lock_guard lock(mutex_);
    double longest = 0;
    const auto count = [&](double begin, double end) {
      if (end - begin > kLate) longest = std::max(longest, std::min(end, until) - std::max(begin, from));
    };
    for (const auto& [begin, end] : stalls_) count(begin, end);
    // Whoever asks may have been woken before the sleepers were.
    for (const double due : due_) count(due, monotonic_seconds());
    return longest;
  }

 private:
  static constexpr double kLate = 2e-3;
  void run(unsigned cpu) {
    cpu_set_t only;
    CPU_ZERO(&only);
    CPU_SET(cpu, &only);
    (void)sched_setaffinity(0, sizeof only, &only);
    while (!stop_) {
      const double due = monotonic_seconds() + 1e-3;
      {
        const std::lock_guard lock(mutex_);
        due_[cpu] = due;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      const double woken = monotonic_seconds();
      if (woken - due <= kLate) continue;
      const std::lock_guard lock(mutex_);
      stalls_.emplace_back(due, woken);
    }
  }
  std::mutex mutex_;
  std::vector<std::pair<double, double>> stalls_;
  std::vector<double> due_;  // of every processor's sleeper
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

}  // namespace supertac
