// A command line as one line of text, in which a word may hold spaces.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace supertac {

/// The word as a shell takes it: in single quotes where it holds more than letters, digits and -_./,:=+%@.
std::string quoted_word(std::string_view word);

/// The words again. Throws std::invalid_argument where a quote is not closed.
std::vector<std::string> command_words(std::string_view line);

}  // namespace supertac
