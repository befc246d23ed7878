// supertac-evaluate --report: the page holds everything, needs nothing, and says what made it.
#include "data/recordings/simulator.h"
#include "io/files/json.h"
#include "models/files/model_file.h"
#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

using EvaluationPage = OnSimulatedData;

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; at += part.size()) ++found;
  return found;
}

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
  for (const char* outside : {"http://", "https://", "src=\"/", "url(", "<!--content", "{{"})
    EXPECT_FALSE(contains(page, outside));
  EXPECT_FALSE(contains(page, "<model>"));  // names are no markup
  const auto scores = parse_json_limited(bytes("r.json"));
  for (const std::string& text :
       {std::string("ridge"), std::string("3_Bumps"), std::string("&lt;model>"),
        "hash " + scores["data"].get<std::string>(), std::string("--report"), std::string("commit ")})
    EXPECT_TRUE(contains(page, text));
  for (const char* part : {"alt=\"felt, ", "alt=\"drawn, ", "alt=\"true, ", "alt=\"difference, "})
    EXPECT_EQ(count(page, part), 24U) << part;
  EXPECT_EQ(run(line).code, 1);  // nothing is overwritten
}

}  // namespace
}  // namespace supertac
