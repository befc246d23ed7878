// supertac-check: what it finds, and that it finds what is wrong.

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "data/plates/stl.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::check_test {

// The ops whose results are recorded, by the sources themselves: record("name", ...), or another function
// that is given the name and does not refuse arguments. What takes inputs apart has no gradient.
std::set<std::string> ops_in_sources() {
  std::set<std::string> names;
  const std::regex recorded(R"re(\b(?!check_|refuse)\w+\(\s*"([a-z0-9_]+)")re");
  for (const auto& entry : std::filesystem::directory_iterator(SUPERTAC_SOURCE "/autograd/ops")) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = read_text_file(entry.path(), 1 << 20);
    for (std::sregex_iterator i(text.begin(), text.end(), recorded), end; i != end; ++i)
      names.insert((*i)[1]);
  }
  names.erase("take_runs"), names.erase("last_frame");
  return names;
}

using Check = ProgramTest;
using CheckGradients = ProgramTest;

TEST_F(CheckGradients, EveryOpOfTheSourcesIsRight) {
  const ProcessResult result = succeed("supertac-check gradients --json -");
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

// The page has the same.
TEST_F(Check, TheBitsOfThisProcessor) {
  const auto said = nlohmann::json::parse(succeed("supertac-check bits --json -").out);
  const std::string page = read_text_file(SUPERTAC_SOURCE "/docs/bits.md", 1 << 20);
  EXPECT_GE(said["paths"].size(), 1U);
  for (const auto& row : said["paths"]) {
    std::string cells = "|";
    for (const char* what : {"recording", "training", "pictures", "int8"})
      cells += " " + row[what].get<std::string>() + " |";
    EXPECT_TRUE(contains(page, cells + "\n")) << row;
  }
}

TEST_F(Check, TheMachineIsDescribed) {
  const ProcessResult result = succeed("supertac-check machine --json -");
  std::set<std::string> found;
  const auto described = nlohmann::json::parse(result.out);
  for (const auto& row : described["findings"]) found.insert(row["what"]);
  for (const char* what :
       {"processor", "threads", "memory", "disk", "serial ports' group", "the rig's board"})
    EXPECT_TRUE(found.contains(what)) << what;
}

// One, with its conditions and assignments, among comments.
TEST_F(Check, PrintsAUdevRule) {
  const std::string comments = "(#.*\n)*", rule = "SUBSYSTEM==\"tty\", .*TAG\\+=\"uaccess\".*\n";
  const std::string said = succeed("supertac-check udev").out;
  EXPECT_TRUE(std::regex_match(said, std::regex(comments + rule + comments))) << said;
}

TEST_F(Check, WhatItDoesNotReadIsRefused) {
  for (const std::string words : {"file f --data d", "bits f", "training f o --data d", "step f o"})
    expect_failure(run("supertac-check " + words), 2,
                   ": nothing that " + words.substr(0, words.find(' ')) + " reads; leave it out");
}

class Audit : public Training {
 protected:
  // With a ledger.
  static void train(const std::string& out, const std::string& more = "") {
    trained(out, "--epochs 4 --ledger 2 " + more);
  }
  static ProcessResult audit(const std::string& model, const std::string& segments) {
    return run("supertac-check training " + model + " --data data --segments " + segments);
  }
  // What a program that is no one of ours says, and its status.
  static int python(const std::string& words, const std::string& said) {
    const std::string line =
        "cd " + folder_->path() + " && " SUPERTAC_PYTHON " " SUPERTAC_SOURCE "/examples/" + words;
    return std::system((line + " > " + said + " 2>&1").c_str());
  }
  static bool has_numpy() { return std::system(SUPERTAC_PYTHON " -c 'import numpy' 2>/dev/null") == 0; }
};

TEST_F(Audit, AModelSaysWhatItWasMadeFrom) {
  train("made.safetensors", "--seed 3 --threads 1");
  const auto info = run("supertac-info made.safetensors --json -");
  const auto card = nlohmann::json::parse(info.out);
  const auto provenance = card["metadata"]["provenance"];
  EXPECT_EQ(provenance["command"],
            "supertac-train --epochs 4 --batch 8 --timesteps 32 --scale 2 --stride 8 --latent 3");
  EXPECT_EQ(provenance["seed"], "3");
  EXPECT_EQ(provenance["parents"]["recordings"].get<std::string>().size(), 64U);
  const auto folder = nlohmann::json::parse(run("supertac-info data --json -").out);
  EXPECT_EQ(folder["content"], provenance["parents"]["recordings"]);
  EXPECT_TRUE(contains(folder["provenance"][0]["command"].get<std::string>(), "supertac-simulate"));

  succeed("supertac-check file made.safetensors data");
  std::filesystem::copy(path("data"), path("fewer"));
  std::filesystem::remove(list_recordings(path("fewer")).front());
  const auto other = run("supertac-check file made.safetensors fewer");
  EXPECT_EQ(other.code, 1);
  EXPECT_TRUE(contains(other.out, "NOT made from"));
}

TEST_F(Audit, APartThatIsRepeatedGivesTheLedgersLines) {
  train("kept.safetensors");
  EXPECT_EQ(audit("kept.safetensors", "1000").code, 0);
  EXPECT_TRUE(contains(audit("kept.safetensors", "1").out, "\n1 of "));

  // A state is exchanged for that of another training.
  train("other.safetensors", "--learning-rate 0.0009");
  std::filesystem::copy(path("other.safetensors"), path("kept.safetensors"),
                        std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(audit("kept.safetensors", "1").code, 1);
}

TEST_F(Audit, NamesMayHoldSpaces) {
  write_file(path("my plate.stl"), stl_bytes(mesh_of(Plate::named("6_Bumps")), "6_Bumps"));
  const std::vector<std::vector<std::string>> commands = {
      {"supertac-simulate", "--out", path("my data"), "--plates", path("my plate.stl"), "--speeds", "10",
       "--passes", "1"},
      {"supertac-train", "--data", path("my data"), "--out", path("my model.safetensors"), "--plates",
       "my plate.stl", "--preset", "tiny", "--stride", "64", "--epochs", "1", "--ledger", "1"},
      {"supertac-check", "training", path("my model.safetensors"), "--data", path("my data")}};
  for (const std::vector<std::string>& words : commands) {
    const ProcessResult result = run_process(words[0], {words.begin() + 1, words.end()});
    EXPECT_EQ(result.code, 0) << words[0] << ": " << result.out << result.error;
  }
}

TEST_F(Audit, ALedgerThatWasChangedIsRefused) {
  train("told.safetensors");
  std::string text = bytes("told.run/ledger.jsonl");
  const std::size_t at = text.find("\"batches\":\"", text.size() / 2) + 11;
  text[at] = text[at] == '0' ? '1' : '0';
  write_file(path("told.run/ledger.jsonl"), text);
  expect_exit(audit("told.safetensors", "1"), 1, "the chain is broken");
}

// Two trainings of the same recordings by recipes that differ in one number.
TEST_F(Audit, TwoTrainingsPartAtAnOperator) {
  train("first.safetensors");
  train("second.safetensors", "--beta 0.002");
  if (!std::filesystem::exists(SUPERTAC_PYTHON)) GTEST_SKIP() << "there is no Debian Python here";
  const auto compare = [&](const std::string& two, const std::string& said) {
    const int code = python("verify_ledger.py " + two, "said.txt");
    EXPECT_TRUE(std::regex_search(bytes("said.txt"), std::regex(said))) << bytes("said.txt");
    return code;
  };
  const std::string ledger = "first.run/ledger.jsonl ";
  EXPECT_NE(compare(ledger + "second.run/ledger.jsonl", "^step 2, encoder\\.0\\.conv\\.0\\.weight: "), 0);
  EXPECT_EQ(compare(ledger + ledger, "^the same in [1-9][0-9]* rows\n$"), 0);

  // A line that its run, killed, tore off in the middle; one that somebody changed.
  std::string text = bytes("first.run/ledger.jsonl");
  write_file(path("torn"), text.substr(0, text.size() - 9));
  EXPECT_EQ(compare(ledger + "torn", "^the same in [1-9][0-9]* rows; torn ends earlier\n$"), 0);
  char& digit = text[text.size() - 9];
  digit = digit == '0' ? '1' : '0';
  write_file(path("changed"), text);
  EXPECT_NE(compare(ledger + "changed", "^changed, line [0-9]+: the chain is broken"), 0);

  // The same step of both, each opened for itself.
  for (const std::string name : {"first", "second"})
    succeed("supertac-check step " + name + ".safetensors --data data --step 1 --json " + name + ".json");
  EXPECT_NE(compare("first.json second.json", "^0/[0-9]+\\.scale, the settings: "), 0);
  EXPECT_EQ(compare("first.json first.json", "^the same in "), 0);
  auto fewer = json("first.json");
  fewer["operators"].erase(fewer["operators"].size() - 1);
  write_file(path("fewer.json"), fewer.dump());
  EXPECT_NE(compare("first.json fewer.json", "step 1 of [0-9]+ operators and step 1 of [0-9]+ operators"), 0);
}

// Every operator of a step once more by NumPy, to the bit, and one of which a bit was changed.
TEST_F(Audit, ARefereeComputesAStepAgain) {
  train("judged.safetensors", "--batch 32");
  const auto open = [&](const std::string& name, const std::string& out) {
    return run("supertac-check step judged.safetensors --data data --step 3 --operator " + name + " --out " +
               out);
  };
  EXPECT_EQ(open("9/", "none.safetensors").code, 2);
  if (!has_numpy()) GTEST_SKIP() << "there is no Debian Python with NumPy here";
  const auto judge = [](const std::string& file) { return python("referee.py " + file, "judged.txt"); };
  for (const std::string name : {"0/", "7/", "sum/", "norm", "update/"}) {
    const std::string file = "judged_" + name.substr(0, 1) + ".safetensors";
    const auto opened = open(name, file);
    ASSERT_EQ(opened.code, 0) << opened.out << opened.error;
    EXPECT_EQ(judge(file), 0) << bytes("judged.txt");
    EXPECT_TRUE(bytes("judged.txt").ends_with(" 0 differ\n")) << bytes("judged.txt");
  }
  const SafetensorsFile file = SafetensorsFile::read(path("judged_0.safetensors"));
  const auto operators = nlohmann::json::parse(file.metadata().at("operators"));
  for (const auto& ran : operators) {
    if (ran["op"] != "conv_transpose2d" || ran.contains("gy")) continue;
    const std::string name = ran["outputs"][0];
    std::vector<float> values = file.f32(name);
    values[5] = std::nextafter(values[5], 1e9F);
    Sha256 sum;
    sum.add(std::as_bytes(std::span(values)));
    const std::string changed = sum.hex() + name.substr(64);
    std::vector<TensorToWrite> tensors{
        {changed, "F32", file.tensors().at(name).shape, std::as_bytes(std::span(values))}};
    for (const std::string input : ran["inputs"])
      tensors.push_back({input, "F32", file.tensors().at(input).shape, file.bytes(input)});
    nlohmann::json wrong = ran;
    wrong["outputs"][0] = changed;
    write_safetensors(path("wrong.safetensors"), {{"operators", nlohmann::json::array({wrong}).dump()}},
                      tensors);
  }
  EXPECT_NE(judge("wrong.safetensors"), 0);
  EXPECT_TRUE(contains(bytes("judged.txt"), "(conv_transpose2d), output 0: 1 of "));
  EXPECT_TRUE(contains(bytes("judged.txt"), "first [0, 0, 0, 5]"));
  std::ofstream(path("judged.run/ledger.jsonl"), std::ios::app) << "{\"step\":";  // torn
  EXPECT_EQ(python("verify_ledger.py judged.run", "verified.txt"), 0) << bytes("verified.txt");
}

}  // namespace supertac::check_test
