// One window every millisecond, as behind a 1 kHz sensor: latency, memory, and how long after the start of
// the process the first picture is there.
//
//   streaming MODEL [SECONDS = 60]          prints CSV
//
// `wall` is from the millisecond's beginning to the finished picture, as a user feels it. It holds what the
// machine does: `wake` is how long after the millisecond the system wakes the program, before any work, and
// on a busy or virtual machine other programs' turns. `cpu` is the processor time of the work itself.
#include <spawn.h>
#include <sys/wait.h>
#include <time.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>

#include "bench/fma_peak.h"
#include "bench/windows.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"

extern char** environ;

namespace supertac {
namespace {

constexpr double kPeriod = 1e-3;

double now() {
  timespec t{};
  ::clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void sleep_until(double time) {
  timespec t{};
  t.tv_sec = static_cast<time_t>(time);
  t.tv_nsec = static_cast<long>((time - static_cast<double>(t.tv_sec)) * 1e9);
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

double status_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    double kilobytes = 0;
    if (line.starts_with(key + ":") && std::istringstream(line.substr(key.size() + 1)) >> kilobytes)
      return kilobytes * 1024e-6;
  }
  return 0;
}

void print_quantiles(const char* name, std::vector<double> seconds) {
  for (const auto& [share, label] : {std::pair{0.5, "median"}, {0.99, "p99"}, {0.999, "p99.9"}, {1.0, "max"}})
    std::cout << name << "_" << label << "_us," << format(1e6 * quantile(seconds, share), 1) << "\n";
}

// The process whose start is timed: `started` is the monotonic clock just before it was made.
int stream(double started, const std::string& model_path, double seconds) {
  const auto model = load_model(model_path).model;
  const Dim timesteps = model->settings().timesteps, frames = 4096;
  const Tensor track = bench::random_windows(1, frames + timesteps);
  Tensor window(Shape{1, timesteps, kTaxels});
  const auto picture_at = [&](std::size_t i) {
    const auto first = static_cast<Dim>(i) % frames * kTaxels;
    std::copy_n(track.data() + first, window.size(), window.data());
    return model->infer(window);
  };
  picture_at(0);
  const double ready = now() - started;

  const auto count = static_cast<std::size_t>(seconds / kPeriod);
  std::vector<double> wall(count), wake(count), cpu(count);
  std::size_t late = 0;
  double due = now() + kPeriod;
  for (std::size_t i = 0; i < count; ++i, due += kPeriod) {
    late += now() > due ? 1 : 0;  // still busy with the window before
    sleep_until(due);
    wake[i] = now() - due;
    const double begin = bench::cpu_seconds();
    picture_at(i);
    cpu[i] = bench::cpu_seconds() - begin;
    wall[i] = now() - due;
  }
  std::cout << "figure,value\nwindows," << count << "\nready_ms," << format(1e3 * ready, 2) << "\n";
  print_quantiles("wall", wall);
  print_quantiles("wake", wake);
  print_quantiles("cpu", cpu);
  std::cout << "late_windows," << late << "\nresident_mb," << format(status_mb("VmRSS"), 2)
            << "\npeak_resident_mb," << format(status_mb("VmHWM"), 2) << "\n";
  return 0;
}

int start(const std::string& model, const std::string& seconds) {
  std::string self = "/proc/self/exe", started = format(now()), path = model, length = seconds;
  char* arguments[] = {self.data(), path.data(), length.data(), started.data(), nullptr};
  pid_t child = 0;
  int status = 1;
  if (::posix_spawn(&child, self.c_str(), nullptr, nullptr, arguments, environ) != 0 ||
      ::waitpid(child, &status, 0) < 0)
    throw std::runtime_error("cannot start the streaming process");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) try {
  if (argc < 2) throw std::runtime_error("expects MODEL [SECONDS]");
  const std::string model = argv[1], seconds = argc > 2 ? argv[2] : "60";
  if (argc < 4) return supertac::start(model, seconds);
  return supertac::stream(supertac::parse_double(argv[3]).value_or(0), model,
                          supertac::parse_double(seconds).value_or(60));
} catch (const std::exception& error) {
  std::cerr << "streaming: " << error.what() << '\n';
  return 1;
}
