// One metadata entry of a model file that is a JSON object, read with checks.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "autograd/tensor.h"
#include "data/sensors/taxel_array.h"
#include "io/files/json.h"

namespace supertac {

/// Every accessor throws std::runtime_error that names path, key, what was expected and found.
class JsonEntry {
 public:
  /// The entry `key` of the metadata of the file `path`.
  JsonEntry(const std::map<std::string, std::string>& metadata, const std::string& path,
            const std::string& key);

  Dim integer(const char* name) const;
  /// true or false; false when it is absent, as in files from before it existed.
  bool flag(const char* name) const;
  /// Whether the object has it: what files from before it existed lack.
  bool has(const char* name) const;
  double number(const char* name) const;
  std::optional<double> number_or_null(const char* name) const;
  /// A number, or [x, y].
  Pitch pitch(const char* name) const;
  std::string text(const char* name) const;
  /// A value as it stands, which the caller has to check.
  const nlohmann::ordered_json& object(const char* name) const { return field(name); }
  const std::string& where() const { return where_; }

 private:
  const nlohmann::ordered_json& field(const char* name) const;
  [[noreturn]] void wrong(const char* name, const std::string& expected,
                          const nlohmann::ordered_json& found) const;

  std::string where_;
  nlohmann::ordered_json json_;
};

}  // namespace supertac
