#include "apps/web/result_page.h"

#include "apps/web/web_options.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::result_page_test {

TEST(ResultPage, IsWholeAndItsDataAreNoMarkup) {
  const std::string page = result_page({{"title", "a </script> <title>"}, {"value", NAN}});
  for (const char* left : {"<!--data", "{{", "http://", "https://", "a </script>"})
    EXPECT_FALSE(contains(page, left));
  EXPECT_TRUE(contains(page, R"({"title":"a \u003c/script> \u003ctitle>","value":null}</script>)"));
}

std::optional<WebAddress> address_of(std::vector<const char*> words) {
  Arguments a("supertac-test", "Tests.");
  declare_web(a);
  words.insert(words.begin(), {"supertac-test", "--quiet"});
  a.parse(static_cast<int>(words.size()), words.data());
  return web_address(a);
}

TEST(WebOption, NamesAPortAndWhoMaySee) {
  EXPECT_FALSE(address_of({}));
  EXPECT_EQ(address_of({"--web"})->port, 8080);
  EXPECT_TRUE(address_of({"--web", "0"})->is_loopback());
  EXPECT_EQ(address_of({"--web", "0.0.0.0:81"})->port, 81);
  EXPECT_EQ(address_of({"--web", "0.0.0.0:81"})->bind, "0.0.0.0");
  for (const char* wrong : {"65536", "-1", "x", "0.0.0.0:", "1:2:3"})
    EXPECT_EQ(what_of<UsageError>([&] {
                address_of({"--web", wrong});
              }),
              "--web: expected PORT or ADDRESS:PORT with a port from 0 to 65535, found '" +
                  std::string(wrong) + "'");
}

}  // namespace supertac::result_page_test
