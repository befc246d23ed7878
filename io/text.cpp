#include "io/text.h"

namespace supertac {

std::string in_quotes(std::string_view text) {
  constexpr size_t kLongest = 60;
  std::string result = "'";
  for (const char c : text.substr(0, kLongest)) result += (c >= ' ' && c <= '~') ? c : '?';
  if (text.size() > kLongest) result += "...";
  return result + "'";
}

}  // namespace supertac
