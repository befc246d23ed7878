#include "apps/common/running/threads.h"

#include <omp.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "io/numbers/numbers.h"

namespace supertac {
namespace {

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// Version 2 of cgroups: the group's own limit and that of the root of its namespace.
int quota() {
  int lowest = 1 << 20;
  const std::string group = first_line("/proc/self/cgroup");  // "0::/path"
  const std::string path = group.starts_with("0::") ? group.substr(3) : "";
  for (const std::string& folder : {"/sys/fs/cgroup" + path, std::string("/sys/fs/cgroup")}) {
    if (const auto limit = quota_of_cpu_max(first_line(folder + "/cpu.max")))
      lowest = std::min(lowest, *limit);
  }
  return lowest;
}

}  // namespace

std::optional<int> quota_of_cpu_max(std::string_view text) {
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos) return std::nullopt;
  const auto limit = parse_int(text.substr(0, space));
  const auto period = parse_int(text.substr(space + 1));
  if (!limit || !period || *limit <= 0 || *period <= 0) return std::nullopt;
  return static_cast<int>(std::clamp<std::int64_t>((*limit + *period - 1) / *period, 1, 1 << 20));
}

int default_threads() { return std::min(omp_get_max_threads(), quota()); }

}  // namespace supertac
