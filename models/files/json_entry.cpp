#include "models/files/json_entry.h"

#include <cmath>
#include <stdexcept>

#include "data/sensors/sensor.h"

namespace supertac {

using Json = nlohmann::ordered_json;

JsonEntry::JsonEntry(const std::map<std::string, std::string>& metadata, const std::string& path,
                     const std::string& key)
    : where_(path + ": metadata \"" + key + "\"") {
  const auto found = metadata.find(key);
  if (found == metadata.end())
    throw std::runtime_error(where_ + " is missing; the file is no SuperTac model");
  try {
    json_ = parse_json_limited(found->second);
  } catch (const JsonError& error) {
    throw std::runtime_error(where_ + ": " + error.what());
  }
}

Dim JsonEntry::integer(const char* name) const {
  const Json& value = field(name);
  if (!value.is_number_integer() || value < -1'000'000 || value > 1'000'000)
    wrong(name, "a whole number", value);
  return value.get<Dim>();
}

bool JsonEntry::flag(const char* name) const {
  if (!has(name)) return false;
  const Json& value = json_.at(name);
  if (!value.is_boolean()) wrong(name, "true or false", value);
  return value.get<bool>();
}

bool JsonEntry::has(const char* name) const { return json_.is_object() && json_.contains(name); }

double JsonEntry::number(const char* name) const {
  const Json& value = field(name);
  if (!value.is_number() || !std::isfinite(value.get<double>())) wrong(name, "a finite number", value);
  return value.get<double>();
}

std::optional<double> JsonEntry::number_or_null(const char* name) const {
  return field(name).is_null() ? std::nullopt : std::optional(number(name));
}

Pitch JsonEntry::pitch(const char* name) const {
  try {
    return pitch_of_json(field(name));
  } catch (const std::invalid_argument&) {
    wrong(name, "a number, or two", field(name));
  }
}

std::string JsonEntry::text(const char* name) const {
  const Json& value = field(name);
  if (!value.is_string()) wrong(name, "a text", value);
  return value.get<std::string>();
}

const Json& JsonEntry::field(const char* name) const {
  if (!has(name)) throw std::runtime_error(where_ + " has no \"" + name + "\"");
  return json_.at(name);
}

void JsonEntry::wrong(const char* name, const std::string& expected, const Json& found) const {
  throw std::runtime_error(where_ + ": \"" + name + "\" must be " + expected + ", found " +
                           found.dump(-1, ' ', true).substr(0, 60));
}

}  // namespace supertac
