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

/// Base of our SAX handlers: nlohmann's interface with every value refused. A handler overrides the values it
/// takes; an override that refuses returns refuse("why").
class JsonHandler : public nlohmann::json_sax<nlohmann::json> {
 public:
  const std::string& problem() const { return problem_; }

  bool null() override { return refuse("null is not allowed here"); }
  bool boolean(bool) override { return refuse("a boolean is not allowed here"); }
  bool number_integer(std::int64_t) override { return refuse("a negative number is not allowed here"); }
  bool number_unsigned(std::uint64_t) override { return refuse("a number is not allowed here"); }
  bool number_float(double, const std::string&) override {
    return refuse("a fraction or a number beyond 64 bits is not allowed here");
  }
  bool string(std::string&) override { return refuse("a string is not allowed here"); }
  bool binary(nlohmann::json::binary_t&) override { return refuse("binary data is not allowed here"); }
  bool start_object(std::size_t) override { return refuse("an object is not allowed here"); }
  bool key(std::string&) override { return refuse("a key is not allowed here"); }
  bool end_object() override { return refuse("'}' is not allowed here"); }
  bool start_array(std::size_t) override { return refuse("an array is not allowed here"); }
  bool end_array() override { return refuse("']' is not allowed here"); }
  bool parse_error(std::size_t position, const std::string& last_token,
                   const nlohmann::json::exception& error) override;

 protected:
  /// Stops the parse; the first reason is kept. Always false.
  bool refuse(const std::string& why);

 private:
  std::string problem_;
};

/// Runs the handler over the whole text. Throws JsonError when the text is not JSON (a NUL byte is refused
/// too: the parser would take it for the end) or the handler refuses.
void parse_json(std::string_view text, JsonHandler& handler);

/// The document as a tree, keys in the order of the text. Throws JsonError.
nlohmann::ordered_json parse_json_limited(std::string_view text, const JsonLimits& limits = {});

}  // namespace supertac
