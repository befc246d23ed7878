#include "apps/web/chart.h"

#include <gtest/gtest.h>

#include <cmath>

#include "apps/web/result_page.h"
#include "apps/web/web_options.h"
#include "io/numbers/numbers.h"
#include "tests/apps/common/expect.h"
#include "tests/expect_error.h"

namespace supertac {
namespace {

using Numbers = std::vector<double>;

// The y of a series' points on the page, in their order.
Numbers heights(const std::string& svg) {
  const std::size_t begin = svg.find("points=\"") + 8;
  const std::string points = svg.substr(begin, svg.find('"', begin) - begin);
  Numbers found;
  for (std::size_t at = 0; (at = points.find(',', at)) != std::string::npos;)
    ++at, found.push_back(*parse_double(points.substr(at, points.find(' ', at) - at)));
  return found;
}

TEST(Chart, AxesHaveRoundNumbersWithinTheirRange) {
  EXPECT_EQ(round_numbers(0.61, 1, false), (Numbers{0.7, 0.8, 0.9, 1}));
  EXPECT_EQ(round_numbers(0, 2300, false), (Numbers{0, 500, 1000, 1500, 2000}));
  EXPECT_EQ(round_numbers(0.002, 0.3, true), (Numbers{0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2}));
  EXPECT_EQ(round_numbers(1, 1e6, true).front(), 1);
  EXPECT_LE(round_numbers(1e-9, 1e9, true).size(), 8U);
}

TEST(Chart, AnAxisEndsWhereItsValuesDo) {
  const std::string svg = chart_svg("SSIM", {.label = "step"}, {.label = "SSIM", .most = 1},
                                    {{.name = "a", .points = {{0, .5}, {9, .99}}}});
  EXPECT_FALSE(contains(svg, ">1.0"));
  EXPECT_TRUE(contains(svg, ">1<"));
  EXPECT_FALSE(contains(svg, ">1.1<"));
}

TEST(Chart, EqualFactorsAreEqualStepsOnALogarithmicAxis) {
  const Numbers y =
      heights(chart_svg("", {.label = ""}, {.label = "", .logarithmic = true},
                        {{.name = "a", .points = {{0, .01}, {1, .1}, {2, 1}, {3, -1}, {4, NAN}}}}));
  ASSERT_EQ(y.size(), 3U);
  EXPECT_NEAR(y[0] - y[1], y[1] - y[2], 0.11);
  EXPECT_GT(y[0], y[1]);
}

TEST(Chart, NamesAreNoMarkup) {
  const std::string svg = chart_svg("<b>", {.label = "<x>"}, {.label = ""},
                                    {{.name = "<a>", .points = {{0, 1}}}, {.name = "b", .points = {{1, 2}}}});
  for (const char* raw : {"<b>", "<x>", "<a>"}) EXPECT_FALSE(contains(svg, raw));
  EXPECT_EQ(escaped("a<b & \"c\""), "a&lt;b &amp; &quot;c&quot;");
}

TEST(Chart, NothingToShowIsNoChart) {
  EXPECT_EQ(
      chart_svg("", {.label = ""}, {.label = "", .logarithmic = true}, {{.name = "a", .points = {{0, 0}}}}),
      "");
}

TEST(ResultPage, IsWhole) {
  const std::string page = result_page("a <title>", "content");
  for (const char* left : {"<!--title", "<!--content", "{{", "http://", "https://"})
    EXPECT_FALSE(contains(page, left));
  EXPECT_TRUE(contains(page, "<title>a &lt;title></title>"));
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

}  // namespace
}  // namespace supertac
