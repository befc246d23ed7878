#include "io/text.h"

namespace supertac {

std::string printable(std::string_view text, size_t longest) {
  std::string result;
  for (const char c : text.substr(0, longest)) result += (c >= ' ' && c <= '~') ? c : '?';
  return text.size() > longest ? result + "..." : result;
}

std::string in_quotes(std::string_view text) { return "'" + printable(text) + "'"; }

}  // namespace supertac
