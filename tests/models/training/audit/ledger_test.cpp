// The ledger's file and its comparison; whole trainings are compared in tests/apps/models/check_test.cpp.
#include "models/training/audit/ledger.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/files/file.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

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

/// Of the lines of a step in two ledgers.
std::optional<LedgerDifference> difference_at(std::int64_t step, const Ledger& one, const Ledger& other) {
  return difference(one, one.at(step).value(), other.at(step).value());
}

TEST(Ledger, AgreesWithItself) {
  const Ledger run = read(ledger_of(kRun));
  EXPECT_EQ(run.every, 5);
  EXPECT_EQ(run.lines.size(), 3U);
  for (const std::int64_t step : {5, 10, 15}) EXPECT_FALSE(difference_at(step, run, run));
  EXPECT_FALSE(run.at(7));
}

TEST(Ledger, NamesTheStepAndTheFirstTensorThatDiffers) {
  const Ledger run = read(ledger_of(kRun));
  for (std::size_t at = 0; at < kRun.size(); ++at) {
    std::vector<Entry> changed = kRun;
    changed[at].second += "0";
    const auto found = difference_at(static_cast<std::int64_t>(5 * at + 5), run, read(ledger_of(changed)));
    ASSERT_TRUE(found) << at;
    EXPECT_EQ(found->step, static_cast<std::int64_t>(5 * at + 5));
    EXPECT_EQ(found->after, static_cast<std::int64_t>(5 * at));
    EXPECT_EQ(found->what, "b");
    EXPECT_FALSE(found->batches);
  }
}

TEST(Ledger, NamesTheBatchesWhereAllTensorsAreTheSame) {
  std::vector<Entry> changed = kRun;
  changed[1].batches = "w";
  const auto found = difference_at(10, read(ledger_of(kRun)), read(ledger_of(changed)));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->step, 10);
  EXPECT_EQ(found->what, "the batches");
  EXPECT_TRUE(found->batches);
}

}  // namespace
}  // namespace supertac
