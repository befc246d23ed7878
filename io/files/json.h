// JSON from files of unknown origin, parsed with limits. A plain tree parse of such text can overflow the
// stack (nesting), take twenty times the text in memory, and lets duplicate keys pass.
#pragma once

#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/file.h"
#include "io/numbers/text.h"

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

/// A value as text for a message: printable ASCII, cut where it is long.
std::string shown(const nlohmann::ordered_json& json);

/// A JSON object whose values are read with checks. Every accessor throws FileError that names the key, what
/// was expected and found; a value that is absent is the fallback, or refused where there is none.
class JsonObject {
 public:
  /// `where` names the object in messages, `prefix` stands before its keys there. Throws FileError when
  /// `json` is no object.
  JsonObject(nlohmann::ordered_json json, std::string where, std::string prefix = {});
  /// The entry `key` of the metadata of the file `path`. Throws FileError when it is missing or no object.
  JsonObject(const std::map<std::string, std::string>& metadata, const std::string& path,
             const std::string& key);

  /// The value as it stands, which the caller has to check; null when it is absent and not required.
  const nlohmann::ordered_json* find(const char* name, bool required = false);
  /// From -1,000,000 to 1,000,000.
  int integer(const char* name, std::optional<int> fallback = {});
  double number(const char* name, std::optional<double> fallback = {});
  std::string text(const char* name, const std::optional<std::string>& fallback = {});
  bool flag(const char* name, bool fallback);
  /// None when it is absent.
  std::vector<int> integers(const char* name);
  std::vector<double> numbers(const char* name);
  /// The value of one of the names of a table.
  template <class Table>
  auto one_of(const char* name, const Table& table, const std::optional<std::string>& fallback = {}) {
    const std::string word = text(name, fallback);
    for (const auto& [known, value] : table)
      if (word == known) return value;
    wrong(name, "one of " + joined(table, ", ", [](const auto& entry) { return entry.first; }), word);
  }
  /// Refuses keys that nobody has asked for.
  void no_others() const;
  [[noreturn]] void wrong(const char* name, const std::string& expected,
                          const nlohmann::ordered_json& found) const;
  const std::string& where() const { return where_; }

 private:
  int whole(const char* name, const nlohmann::ordered_json& value) const;

  nlohmann::ordered_json json_;
  std::string where_, prefix_;
  std::vector<std::string> known_;
};

}  // namespace supertac
