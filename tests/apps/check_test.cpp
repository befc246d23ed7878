// supertac-check: what it finds, and that it finds what is wrong.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "io/file.h"
#include "tests/apps/process.h"

namespace supertac {
namespace {

// The ops whose results are recorded, by the sources themselves: record("name", ...), or a function that is
// given the name. take_runs has no gradient.
std::set<std::string> ops_in_sources() {
  std::set<std::string> names;
  const std::regex recorded(R"re((?:record|rectify|convolve|transpose_inner)\(\s*"([a-z0-9_]+)")re");
  for (const auto& entry : std::filesystem::directory_iterator(SUPERTAC_SOURCE "/autograd/ops")) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = read_text_file(entry.path(), 1 << 20);
    for (std::sregex_iterator i(text.begin(), text.end(), recorded), end; i != end; ++i)
      names.insert((*i)[1]);
  }
  names.erase("take_runs");
  return names;
}

TEST(CheckGradients, EveryOpOfTheSourcesIsRight) {
  const auto result = run_process("supertac-check", {"gradients", "--json", "-"});
  ASSERT_EQ(result.code, 0) << result.out << result.error;
  const auto table = nlohmann::json::parse(result.out);
  std::set<std::string> ops, kinds;
  for (const auto& row : table["rows"]) {
    kinds.insert(row["kind"]);
    if (row["kind"] == "op") ops.insert(row["name"]);
    EXPECT_GT(row["entries"], 0);
    EXPECT_LE(row["worst"]["relative_error"], 1e-6) << row;
  }
  EXPECT_EQ(ops, ops_in_sources());
  EXPECT_EQ(kinds, (std::set<std::string>{"op", "layer", "loss"}));
}

TEST(CheckGradients, PlantedErrorsAreFoundAndNamed) {
  const auto result = run_process("supertac-check", {"gradients", "--break", "gated_sum", "--json", "-"});
  ASSERT_EQ(result.code, 0) << result.out << result.error;
  const auto table = nlohmann::json::parse(result.out);
  EXPECT_EQ(table["planted"], 12);  // four errors in the gradients of a, x and s
  EXPECT_EQ(table["found"], 12);
  for (const auto& row : table["rows"]) {
    EXPECT_TRUE(row["worst"]["entry"].get<std::string>().starts_with("gated_sum " +
                                                                     std::string(row["input"]).substr(10)))
        << row;
  }
}

TEST(CheckGradients, AnUnknownOpIsNamed) {
  const auto result = run_process("supertac-check", {"gradients", "--break", "gated_sums"});
  EXPECT_EQ(result.code, 2);
  EXPECT_NE(result.error.find("did you mean 'gated_sum'?"), std::string::npos) << result.error;
}

}  // namespace
}  // namespace supertac
