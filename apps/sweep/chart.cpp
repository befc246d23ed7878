#include "apps/sweep/chart.h"

#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>

#include "io/file.h"
#include "io/numbers.h"
#include "io/text.h"

extern char** environ;

namespace supertac {
namespace {

std::string points(const char* block, const std::vector<Configuration>& list) {
  std::string text = "$" + std::string(block) + " << EOD\n";
  for (const Configuration& c : list) {
    text += format(c.mean.at("median_us"), 2) + " " + format(c.mean.at("ssim"), 5) + " \"" +
            printable(c.name, 200) + "\"\n";
  }
  return text + "EOD\n";
}

// Runs a program in a folder, without a shell. Returns 0, the errno that kept it from starting, or -1: it
// failed.
int run_in(const std::string& folder, std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return error;
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? 0 : -1;
}

// Room for the labels, which stand left of their points.
double lowest(const std::vector<Configuration>& all) {
  double us = 1e9;
  for (const Configuration& c : all) us = std::min(us, c.mean.at("median_us"));
  return us;
}

}  // namespace

std::string draw_chart(const std::string& folder, const std::vector<Configuration>& all) {
  const std::string script = folder + "/chart.gnuplot";
  write_file(
      script,
      // No name of a user in it: gnuplot would run what stands between backquotes or in system().
      "# gnuplot chart.gnuplot, in this folder\n" + points("all", all) + points("front", pareto_front(all)) +
          "set terminal pngcairo noenhanced size 1000,640 font ',11'\n"
          "set output 'chart.png'\n"
          "set xlabel 'processor time of a window, us (batch 1, one thread)'\n"
          "set ylabel 'SSIM in contact, mean over seeds'\n"
          "set logscale x\nset xrange [" +
          format(lowest(all) / 3, 3) +
          ":]\nset grid\nset key bottom right\nset offsets 0, 0, 0.02, 0.04\n"
          "plot $all using 1:2 with points pt 7 lc rgb '#bbbbbb' title 'configurations', \\\n"
          "     $front using 1:2 with linespoints pt 7 lw 2 lc rgb '#4477aa' title 'Pareto front', \\\n"
          "     $front using 1:2:3 with labels right offset -1,0.5 font ',9' notitle\n");
  const int error = run_in(folder, {"gnuplot", "chart.gnuplot"});
  if (error == 0) return {};
  return (error == ENOENT ? "gnuplot is not installed: " : "gnuplot failed: ") + script + " waits for it";
}

}  // namespace supertac
