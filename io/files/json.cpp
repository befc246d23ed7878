#include "io/files/json.h"

#include <algorithm>
#include <set>
#include <utility>

namespace supertac {
namespace {

using Tree = nlohmann::ordered_json;

// Builds the tree and counts while doing so.
class TreeBuilder : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit TreeBuilder(const JsonLimits& limits) : limits_(limits) {}
  Tree take() { return std::move(root_); }
  const std::string& problem() const { return problem_; }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(std::int64_t value) override { return add(value); }
  bool number_unsigned(std::uint64_t value) override { return add(value); }
  bool number_float(double value, const std::string&) override { return add(value); }
  bool string(std::string& value) override { return add(std::move(value)); }
  bool binary(nlohmann::json::binary_t&) override { return false; }  // there is none in text
  bool start_object(std::size_t) override { return open(Tree::object()); }
  bool start_array(std::size_t) override { return open(Tree::array()); }
  bool end_object() override { return levels_.pop_back(), true; }
  bool end_array() override { return levels_.pop_back(), true; }

  bool key(std::string& name) override {
    Level& level = levels_.back();
    if (!level.keys.insert(name).second) return refuse("the key " + in_quotes(name) + " appears twice");
    level.key = name;
    return count();
  }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::json::exception& error) override {
    return refuse(error.id == 406 ? "a number is out of range"
                                  : "not valid JSON at byte " + std::to_string(position));
  }

 private:
  struct Level {
    Tree* node;
    std::string key;             // of the next value, in an object
    std::set<std::string> keys;  // so far: ordered_json itself would search linearly for each
  };

  /// Stops the parse.
  bool refuse(const std::string& why) {
    problem_ = why;
    return false;
  }

  bool count() {
    if (++values_ <= limits_.max_values) return true;
    return refuse("more than " + std::to_string(limits_.max_values) + " values");
  }

  Tree* place(Tree value) {
    if (levels_.empty()) return &(root_ = std::move(value));
    Level& level = levels_.back();
    if (level.node->is_array()) return &level.node->emplace_back(std::move(value));
    // Appended to the vector behind the map, past its linear search: the key has been seen to be new.
    Tree::object_t::Container& pairs = level.node->get_ref<Tree::object_t&>();
    return &pairs.emplace_back(level.key, std::move(value)).second;
  }

  bool add(Tree value) {
    place(std::move(value));
    return count();
  }

  bool open(Tree value) {
    if (levels_.size() == limits_.max_depth) {
      return refuse("nested deeper than " + std::to_string(limits_.max_depth) + " levels");
    }
    // The pointer stays valid: the parent does not grow before this level is closed.
    levels_.push_back({place(std::move(value)), {}, {}});
    return count();
  }

  JsonLimits limits_;
  Tree root_;
  std::vector<Level> levels_;
  std::size_t values_ = 0;
  std::string problem_;
};

Tree parsed_entry(const std::map<std::string, std::string>& metadata, const std::string& path,
                  const std::string& key) {
  const auto found = metadata.find(key);
  try {
    if (found != metadata.end()) return parse_json_limited(found->second);
  } catch (const JsonError& error) {
    throw FileError(path, "metadata \"" + key + "\": " + error.what());
  }
  throw FileError(path, "metadata \"" + key + "\" is missing; the file is no SuperTac model");
}

}  // namespace

std::string shown(const Tree& json) {
  return printable(json.dump(-1, ' ', true, Tree::error_handler_t::replace));
}

nlohmann::ordered_json parse_json_limited(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.max_bytes) {
    throw JsonError("has " + std::to_string(text.size()) + " bytes, expected at most " +
                    std::to_string(limits.max_bytes));
  }
  if (text.find('\0') != std::string_view::npos) throw JsonError("not valid JSON: holds a NUL byte");
  TreeBuilder builder(limits);
  if (!nlohmann::json::sax_parse(text.begin(), text.end(), &builder)) throw JsonError(builder.problem());
  return builder.take();
}

JsonObject::JsonObject(Tree json, std::string where, std::string prefix)
    : json_(std::move(json)), where_(std::move(where)), prefix_(std::move(prefix)) {
  if (!json_.is_object()) throw FileError(where_, "expected an object {...}, found " + shown(json_));
}

JsonObject::JsonObject(const std::map<std::string, std::string>& metadata, const std::string& path,
                       const std::string& key)
    : JsonObject(parsed_entry(metadata, path, key), path + ": metadata \"" + key + "\"") {}

const Tree* JsonObject::find(const char* name, bool required) {
  if (std::ranges::find(known_, name) == known_.end()) known_.emplace_back(name);
  if (json_.contains(name)) return &json_.at(name);
  if (required) throw FileError(where_, "expected a key \"" + prefix_ + name + "\", found none");
  return nullptr;
}

int JsonObject::integer(const char* name, std::optional<int> fallback) {
  const Tree* value = find(name, !fallback);
  return value == nullptr ? *fallback : whole(name, *value);
}

double JsonObject::number(const char* name, std::optional<double> fallback) {
  const Tree* value = find(name, !fallback);
  if (value == nullptr) return *fallback;
  if (!value->is_number()) wrong(name, "a number", *value);
  return value->get<double>();
}

std::string JsonObject::text(const char* name, const std::optional<std::string>& fallback) {
  const Tree* value = find(name, !fallback);
  if (value == nullptr) return *fallback;
  if (!value->is_string()) wrong(name, "a text", *value);
  return value->get<std::string>();
}

bool JsonObject::flag(const char* name, bool fallback) {
  const Tree* value = find(name);
  if (value == nullptr) return fallback;
  if (!value->is_boolean()) wrong(name, "true or false", *value);
  return value->get<bool>();
}

std::vector<int> JsonObject::integers(const char* name) {
  const Tree* value = find(name);
  if (value == nullptr) return {};
  if (!value->is_array()) wrong(name, "a list of whole numbers", *value);
  std::vector<int> list;
  for (const Tree& element : *value) list.push_back(whole(name, element));
  return list;
}

std::vector<double> JsonObject::numbers(const char* name) {
  const Tree* value = find(name);
  if (value == nullptr) return {};
  std::vector<double> list;
  for (const Tree& element : value->is_array() ? *value : Tree::array({nullptr})) {
    if (!element.is_number()) wrong(name, "a list of numbers", *value);
    list.push_back(element.get<double>());
  }
  return list;
}

void JsonObject::no_others() const {
  for (const auto& [name, value] : json_.items())
    if (std::ranges::find(known_, name) == known_.end())
      throw FileError(where_,
                      "knows no key " + in_quotes(prefix_ + name) + "; it may have " + joined(known_, ", "));
}

void JsonObject::wrong(const char* name, const std::string& expected, const Tree& found) const {
  throw FileError(where_, "\"" + prefix_ + name + "\" must be " + expected + ", found " + shown(found));
}

int JsonObject::whole(const char* name, const Tree& value) const {
  if (!value.is_number_integer() || value < -1'000'000 || value > 1'000'000)
    wrong(name, "a whole number", value);
  return value.get<int>();
}

}  // namespace supertac
