// The ledger's file and its comparison, and steps that are opened: they change nothing, end in the ledger's
// line and show where every number came from. tests/apps/models/check_test.cpp compares whole trainings, and
// judges steps.
#include "models/training/audit/ledger.h"

#include <nlohmann/json.hpp>

#include "models/training/audit/opened_step.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::ledger_test {

struct Entry {
  std::string batches, first, second;
};

/// The text of a ledger of two tensors with a line every five steps.
std::string ledger_of(const std::vector<Entry>& entries) {
  using Json = nlohmann::ordered_json;
  const std::string header =
      Json{{"format", "supertac-ledger-2"}, {"every", 5}, {"tensors", {"a", "b"}}}.dump();
  std::string file = header + "\n", chain = sha256(header);
  std::int64_t step = 0;
  for (const Entry& e : entries) {
    const LedgerLine line{step += 5, e.batches, {e.first, e.second}, {}};
    chain = sha256(chain + line.text(false));
    Json json = Json::parse(line.text(false));
    json["chain"] = chain;
    file += json.dump() + "\n";
  }
  return file;
}

Ledger read(const std::string& text) {
  const TemporaryFolder folder;
  write_file(folder.file("ledger.jsonl"), text);
  return Ledger::read(folder.file("ledger.jsonl"));
}

const std::vector<Entry> kRun = {{"x", "1", "2"}, {"y", "3", "4"}, {"z", "5", "6"}};

TEST(Ledger, NamesTheStepAndTheFirstTensorThatDiffersOrTheBatches) {
  const Ledger run = read(ledger_of(kRun));
  EXPECT_EQ(run.every, 5);
  EXPECT_EQ(run.lines.size(), 3U);
  EXPECT_FALSE(run.at(7));
  for (std::size_t at = 0; at < kRun.size(); ++at)
    for (const bool batches : {false, true}) {
      const auto step = static_cast<std::int64_t>(5 * at + 5);
      std::vector<Entry> changed = kRun;
      (batches ? changed[at].batches : changed[at].second) += "0";
      EXPECT_FALSE(difference(run, run.at(step).value(), run.at(step).value()));
      const auto found = difference(run, run.at(step).value(), read(ledger_of(changed)).at(step).value());
      ASSERT_TRUE(found) << at;
      EXPECT_EQ(found->step, step);
      EXPECT_EQ(found->after, step - 5);
      EXPECT_EQ(found->what, batches ? "the batches" : "b");
      EXPECT_EQ(found->batches, batches);
    }
}

TEST(OpenedSteps, AreStepsLikeAnyOther) {
  const SmallTraining small;
  Trainer plain = small.trainer(), watched = small.trainer();
  LedgerWriter of_plain(plain, 1), of_watched(watched, 1);
  for (int step = 1; step <= 3; ++step) {
    plain.train_step();
    const OpenedStep opened = open_step(watched);
    EXPECT_EQ(opened.step, step);
    const LedgerLine line = *of_watched.after_step();
    EXPECT_EQ(line.chain, of_plain.after_step()->chain);
    // What the updates made is what the line says: its parameters first, then the two moments of each.
    std::vector<std::string> parameters, moments;
    for (const auto& ran : opened.operators) {
      if (!ran["name"].get<std::string>().starts_with("update/")) continue;
      parameters.push_back(ran["outputs"][0].get<std::string>().substr(0, 64));
      for (const int k : {1, 2}) moments.push_back(ran["outputs"][k].get<std::string>().substr(0, 64));
    }
    parameters.insert(parameters.end(), moments.begin(), moments.end());
    EXPECT_EQ(parameters, line.tensors);
  }
}

TEST(OpenedSteps, EveryInputWasMadeBeforeOrIsAConstant) {
  const SmallTraining small;
  Trainer trainer = small.trainer();
  const OpenedStep opened = open_step(trainer);
  std::set<std::string> made;
  std::size_t inputs = 0, constants = 0, unmade = 0;
  for (const auto& ran : opened.operators) {
    if (ran.contains("inputs"))
      for (const std::string input : ran["inputs"]) ++inputs, constants += !made.contains(input);
    if (ran.contains("gy")) {
      EXPECT_TRUE(made.contains(ran["y"])) << ran;
      unmade += !made.contains(ran["gy"]);
    }
    for (const std::string output : ran["outputs"]) made.insert(output);
  }
  EXPECT_GT(inputs, 1000U);
  EXPECT_LT(constants, inputs / 20);
  EXPECT_LE(unmade, 8U);  // dL/dL of each micro-batch, which is 1
}

}  // namespace supertac::ledger_test
