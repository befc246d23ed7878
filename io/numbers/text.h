// Text from outside (names in files, options) made fit for a one-line message.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace supertac {

/// Bytes that are not printable ASCII become '?', more than `longest` bytes are cut with "...". A hostile
/// name can then neither break the line nor send control codes to a terminal.
std::string printable(std::string_view text, std::size_t longest = 60);

/// printable() in single quotes.
std::string in_quotes(std::string_view text);

/// "of: argument expects EXPECTED, got GOT", the form in which an argument is refused; ops do by refuse()
/// (autograd/record.h).
std::string refusal(std::string_view of, std::string_view argument, std::string_view expected,
                    std::string_view got);
/// Throws std::invalid_argument, a refusal(), unless `got` values are as many as expected.
void expect_values(std::string_view of, std::string_view argument, std::size_t expected, std::size_t got);

/// Of ASCII; what is no capital letter stays.
constexpr char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// With blanks behind the text, one at least, or before it, up to a width.
std::string left_aligned(std::string_view text, std::size_t width);
std::string right_aligned(std::string_view text, std::size_t width);

/// Without blanks, tabs and carriage returns at either end.
std::string_view trimmed(std::string_view text);

/// The columns of a line of text, each trimmed; an empty last one is left out. ' ' stands for any white
/// space.
std::vector<std::string_view> split_line(std::string_view line, char separator);

/// The parts between the commas, untrimmed; none for an empty text, and none behind a last comma.
std::vector<std::string> comma_list(const std::string& text);

/// The words or numbers, or that member or function of each, with `between` between them.
template <class Range, class Part = std::identity>
std::string joined(const Range& all, std::string_view between = ",", Part part = {}) {
  std::string text;
  for (const auto& one : all) {
    if (!text.empty()) text += between;
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<std::invoke_result_t<Part&, decltype(one)>>>)
      text += std::to_string(std::invoke(part, one));
    else
      text += std::invoke(part, one);
  }
  return text;
}

}  // namespace supertac
