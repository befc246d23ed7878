#include "io/numbers/text.h"

#include <algorithm>
#include <stdexcept>

namespace supertac {

std::string printable(std::string_view text, std::size_t longest) {
  std::string result;
  for (const char c : text.substr(0, longest)) result += (c >= ' ' && c <= '~') ? c : '?';
  return text.size() > longest ? result + "..." : result;
}

std::string refusal(std::string_view of, std::string_view argument, std::string_view expected,
                    std::string_view got) {
  std::string text(of);
  text.append(": ").append(argument).append(" expects ").append(expected).append(", got ").append(got);
  return text;
}

void expect_values(std::string_view of, std::string_view argument, std::size_t expected, std::size_t got) {
  if (got != expected)
    throw std::invalid_argument(
        refusal(of, argument, std::to_string(expected) + " values", std::to_string(got)));
}

std::string in_quotes(std::string_view text) { return "'" + printable(text) + "'"; }

std::string left_aligned(std::string_view text, std::size_t width) {
  return std::string(text) + std::string(text.size() < width ? width - text.size() : 1, ' ');
}

std::string right_aligned(std::string_view text, std::size_t width) {
  return std::string(text.size() < width ? width - text.size() : 0, ' ').append(text);
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split_line(std::string_view line, char separator) {
  const auto separates = [=](char c) { return c == separator || (separator == ' ' && c == '\t'); };
  std::vector<std::string_view> columns;
  line = trimmed(line);
  while (!line.empty()) {
    const auto end = static_cast<std::size_t>(std::ranges::find_if(line, separates) - line.begin());
    columns.push_back(trimmed(line.substr(0, end)));
    line.remove_prefix(std::min(end + 1, line.size()));
    if (separator == ' ') line = trimmed(line);
  }
  return columns;
}

std::vector<std::string> comma_list(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    words.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  return words;
}

}  // namespace supertac
