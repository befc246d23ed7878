// JSON from files of unknown origin, parsed with limits. A plain tree parse of such text can overflow the
// stack (nesting), take twenty times the text in memory, and lets duplicate keys pass.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

namespace supertac {

struct JsonLimits {
  std::size_t max_bytes = std::size_t{1} << 20;
  std::size_t max_depth = 16;        // nested arrays and objects
  std::size_t max_values = 100'000;  // of any kind, keys included
};

/// The text is not JSON, has a key twice, or exceeds a limit; what() says which and at which byte.
class JsonError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The document as a tree, keys in the order of the text. Throws JsonError (for a NUL byte too: the parser
/// would take it for the end).
nlohmann::ordered_json parse_json_limited(std::string_view text, const JsonLimits& limits = {});

}  // namespace supertac
