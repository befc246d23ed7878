// Numbers as text, the same under every locale (std::from_chars, std::to_chars).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace supertac {

/// The whole text must be the number: no spaces, no leading '+', '.' before the fraction. nullopt when it is
/// not, or when the value does not fit. "nan" and "inf" are numbers here; the caller decides whether they may
/// be.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_int(std::string_view text);
std::optional<std::uint64_t> parse_uint(std::string_view text);

/// The shortest text that reads back as the same value.
std::string format(double value);
std::string format(float value);
/// With a fixed number of decimals, for tables and messages.
std::string format(double value, int decimals);

}  // namespace supertac
