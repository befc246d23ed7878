#include "io/files/json.h"

#include "tests/support/test.h"

namespace supertac::json_test {

std::string message_of(const std::string& text, const JsonLimits& limits = {}) {
  return what_of<JsonError>([&] { parse_json_limited(text, limits); });
}

TEST(Json, ReadsADocumentInItsOrder) {
  const std::string text = R"({"z":1,"a":[true,null,-2,0.5,"x"],"m":{"z":{}}})";
  EXPECT_EQ(parse_json_limited(text).dump(), text);
  EXPECT_EQ(parse_json_limited("3").dump(), "3");
}

TEST(Json, RefusesWhatIsNotJson) {
  for (const std::string text : {"", "{", "{]", "[1,]", "{\"a\":1}x", "nul", "\"\xff\"", "[01]", "1e999"}) {
    EXPECT_NE(message_of(text), "nothing thrown") << text;
  }
  EXPECT_EQ(message_of("{\"a\":x}"), "not valid JSON at byte 6");
  EXPECT_NE(message_of(std::string("{}\0garbage", 10)), "nothing thrown");
}

TEST(Json, RefusesDuplicateKeysAtAnyLevel) {
  EXPECT_EQ(message_of(R"({"a":1,"a":2})"), "the key 'a' appears twice");
  EXPECT_EQ(message_of(R"([{"b":{"a":1,"\u0061":2}}])"), "the key 'a' appears twice");
  EXPECT_EQ(message_of(R"({"a":{"a":1},"b":{"a":1}})"), "nothing thrown");
}

TEST(Json, KeepsItsLimits) {
  EXPECT_EQ(message_of(std::string(16, '[') + std::string(16, ']')), "nothing thrown");
  EXPECT_EQ(message_of(std::string(17, '[') + std::string(17, ']')), "nested deeper than 16 levels");
  EXPECT_EQ(message_of(std::string(1'000'000, '[')), "nested deeper than 16 levels");
  EXPECT_EQ(message_of("[1,2,3]", {.max_values = 3}), "more than 3 values");
  EXPECT_EQ(message_of("[1,2,3]", {.max_bytes = 6}), "has 7 bytes, expected at most 6");
}

}  // namespace supertac::json_test
