// Pages of results: each holds everything, needs nothing, and says what made it. The option that serves a
// page.
#include "apps/web/pages.h"
#include "apps/common/command_line/arguments.h"
#include "apps/web/web_server.h"
#include "data/simulation/simulator.h"
#include "io/files/json.h"
#include "models/files/model_file.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::pages_test {

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

using EvaluationPage = OnSimulatedData;

TEST_F(EvaluationPage, HoldsScoresWindowsAndWhatMadeIt) {
  Rng rng(1);
  const SuperTac model({.timesteps = 32, .latent = 3, .scale = 2, .channels = 8, .rcabs = 1}, rng);
  save_model(path("<model>"), model, {300, {}, SimulatorSettings().filter_s}, {});
  const std::string line =
      "supertac-evaluate --model <model> --data data --split none --limit 2000 --quiet --report report.html "
      "--json r.json";
  succeed(line);
  const std::string page = bytes("report.html");
  EXPECT_LT(page.size(), 5'000'000U);
  for (const char* outside : {"http://", "https://", "src=\"/", "url(", "<!--data", "{{"})
    EXPECT_FALSE(contains(page, outside));
  EXPECT_FALSE(contains(page, "<model>"));  // names are no markup
  const std::string mark = "type=\"application/json\">";
  const std::size_t begin = page.find(mark) + mark.size();
  const auto data = nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  auto scores = json("r.json");
  scores.erase("provenance");
  EXPECT_EQ(data["result"], scores);
  for (const char* some : {"best", "worst"}) {
    ASSERT_EQ(data[some].size(), 12U);
    for (const auto& window : data[some])  // 16 taxels, 64 pixels, as base64
      for (const auto& [what, letters] : {std::pair("felt", 24U), {"drawn", 88U}, {"true", 88U}})
        EXPECT_EQ(window[what].get<std::string>().size(), letters) << what;
  }
  const std::string made_by = data["made_by"].dump();
  for (const std::string& text :
       {"hash " + scores["data"].get<std::string>(), std::string("--report"), std::string("commit ")})
    EXPECT_TRUE(contains(made_by, text));
  EXPECT_EQ(run(line).code, 1);  // nothing is overwritten
}

}  // namespace supertac::pages_test
