#include "apps/common/command_line/nearest.h"

#include <algorithm>
#include <cstddef>

namespace supertac {
namespace {

/// Restricted Damerau-Levenshtein distance, by rows.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

}  // namespace

std::string nearest_name(const std::string& name, const std::vector<std::string>& candidates) {
  std::string nearest;
  std::size_t fewest = name.size();  // a name all of whose letters differ is no hint
  constexpr std::size_t kLongest = 64;
  if (name.empty() || name.size() > kLongest) return nearest;
  for (const std::string& candidate : candidates) {
    const std::size_t changes = distance(name, candidate);
    const bool nearer = changes < fewest || (changes == fewest && candidate.starts_with(name));
    if (!nearer || changes > std::max<std::size_t>(2, candidate.size() / 3)) continue;
    fewest = changes;
    nearest = candidate;
  }
  return nearest;
}

}  // namespace supertac
