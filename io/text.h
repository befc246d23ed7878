// Text from outside (names in files, options) made fit for a one-line message.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace supertac {

/// Bytes that are not printable ASCII become '?', more than `longest` bytes are cut with "...". A hostile
/// name can then neither break the line nor send control codes to a terminal.
std::string printable(std::string_view text, size_t longest = 60);

/// printable() in single quotes.
std::string in_quotes(std::string_view text);

}  // namespace supertac
