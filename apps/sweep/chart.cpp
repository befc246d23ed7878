#include "apps/sweep/chart.h"

#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>

#include "io/file.h"
#include "io/numbers.h"

extern char** environ;

namespace supertac {
namespace {

std::string points(const char* block, const std::vector<Configuration>& list) {
  std::string text = "$" + std::string(block) + " << EOD\n";
  for (const Configuration& c : list) {
    text += format(c.mean.at("median_us"), 2) + " " + format(c.mean.at("ssim"), 5) + " \"" + c.name + "\"\n";
  }
  return text + "EOD\n";
}

// Room for the labels, which stand left of their points.
double lowest(const std::vector<Configuration>& all) {
  double us = 1e9;
  for (const Configuration& c : all) us = std::min(us, c.mean.at("median_us"));
  return us;
}

}  // namespace

bool draw_chart(const std::string& folder, const std::vector<Configuration>& all) {
  const std::string script = folder + "/chart.gnuplot";
  write_file(
      script,
      "# gnuplot " + script + "\n" + points("all", all) + points("front", pareto_front(all)) +
          "set terminal pngcairo noenhanced size 1000,640 font ',11'\n"
          "set output '" +
          folder +
          "/chart.png'\n"
          "set xlabel 'processor time of a window, us (batch 1, one thread)'\n"
          "set ylabel 'SSIM in contact, mean over seeds'\n"
          "set logscale x\nset xrange [" +
          format(lowest(all) / 3, 3) +
          ":]\nset grid\nset key bottom right\nset offsets 0, 0, 0.02, 0.04\n"
          "plot $all using 1:2 with points pt 7 lc rgb '#bbbbbb' title 'configurations', \\\n"
          "     $front using 1:2 with linespoints pt 7 lw 2 lc rgb '#4477aa' title 'Pareto front', \\\n"
          "     $front using 1:2:3 with labels right offset -1,0.5 font ',9' notitle\n");
  std::string program = "gnuplot", argument = script;
  char* arguments[] = {program.data(), argument.data(), nullptr};
  pid_t child = 0;
  if (::posix_spawnp(&child, "gnuplot", nullptr, nullptr, arguments, environ) != 0) return false;
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace supertac
