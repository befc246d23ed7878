#include "io/files/json.h"

#include <set>
#include <utility>
#include <vector>

#include "io/numbers/text.h"

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

}  // namespace

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

}  // namespace supertac
