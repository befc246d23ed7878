#include "io/numbers/numbers.h"

#include <charconv>

namespace supertac {
namespace {

template <class Number>
std::optional<Number> parse(std::string_view text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

template <class... Arguments>
std::string to_text(Arguments... arguments) {
  char text[512];  // the longest: 309 digits before the point and the decimals asked for
  const auto [end, error] = std::to_chars(text, text + sizeof text, arguments...);
  return error == std::errc() ? std::string(text, end) : std::string("?");
}

}  // namespace

std::optional<double> parse_double(std::string_view text) { return parse<double>(text); }
std::optional<std::int64_t> parse_int(std::string_view text) { return parse<std::int64_t>(text); }
std::optional<std::uint64_t> parse_uint(std::string_view text) { return parse<std::uint64_t>(text); }

std::string format(double value) { return to_text(value); }
std::string format(float value) { return to_text(value); }
std::string format(double value, int decimals) { return to_text(value, std::chars_format::fixed, decimals); }

}  // namespace supertac
