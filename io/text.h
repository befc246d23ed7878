// Text from outside (names in files, options) made fit for a one-line message.
#pragma once

#include <string>
#include <string_view>

namespace supertac {

// 'text' in single quotes; bytes that are not printable ASCII become '?', more than 60 bytes are cut with
// "...". A hostile name can then neither break the line nor send control codes to a terminal.
std::string in_quotes(std::string_view text);

}  // namespace supertac
