#include "apps/common/command_line/command_words.h"

#include <stdexcept>

namespace supertac {

std::string quoted_word(std::string_view word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./,:=+%@";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string_view::npos) return std::string(word);
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::vector<std::string> command_words(std::string_view line) {
  std::vector<std::string> words;
  bool quoted = false, inside = false;  // a pair of quotes; a word
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (!quoted && c == ' ') {
      inside = false;
      continue;
    }
    if (!inside) words.emplace_back();
    inside = true;
    if (c == '\'') {
      quoted = !quoted;
    } else {
      words.back() += !quoted && c == '\\' && i + 1 < line.size() ? line[++i] : c;
    }
  }
  if (quoted) throw std::invalid_argument("command line: a quote is not closed");
  return words;
}

}  // namespace supertac
