// supertac-check: what it finds, and that it finds what is wrong.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "data/plates/plate_mesh.h"

#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/sha256.h"
#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

// The ops whose results are recorded, by the sources themselves: record("name", ...), or a function that is
// given the name. What takes inputs apart has no gradient.
std::set<std::string> ops_in_sources() {
  std::set<std::string> names;
  const std::regex recorded(
      R"re((?:record|elementwise|rectify|convolve|transpose_inner)\(\s*"([a-z0-9_]+)")re");
  for (const auto& entry : std::filesystem::directory_iterator(SUPERTAC_SOURCE "/autograd/ops")) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = read_text_file(entry.path(), 1 << 20);
    for (std::sregex_iterator i(text.begin(), text.end(), recorded), end; i != end; ++i)
      names.insert((*i)[1]);
  }
  names.erase("take_runs"), names.erase("last_frame");
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

TEST(Check, TheBitsOfThisProcessor) {
  const auto result = run_process("supertac-check", {"bits", "--report"});
  EXPECT_EQ(result.code, 0) << result.out << result.error;
  // The rows of the page end in the same hashes.
  const std::string page = read_text_file(SUPERTAC_SOURCE "/docs/bits.md", 1 << 20);
  std::istringstream rows(result.out);
  std::size_t count = 0;
  for (std::string row; std::getline(rows, row); ++count) {
    std::smatch hashes;
    ASSERT_TRUE(std::regex_search(row, hashes, std::regex("\\|( [0-9a-f]{16} \\|){4}$"))) << row;
    EXPECT_NE(page.find(hashes[0]), std::string::npos) << row;
  }
  EXPECT_GE(count, 1U);
}

TEST(Check, TheMachineIsDescribed) {
  const auto result = run_process("supertac-check", {"machine", "--json", "-"});
  ASSERT_EQ(result.code, 0) << result.error;
  std::set<std::string> found;
  const auto described = nlohmann::json::parse(result.out);
  for (const auto& row : described["findings"]) found.insert(row["what"]);
  for (const char* what :
       {"processor", "threads", "memory", "disk", "serial ports' group", "the rig's board"})
    EXPECT_TRUE(found.contains(what)) << what;
}

TEST(Check, PrintsAUdevRule) {
  const auto result = run_process("supertac-check", {"udev"});
  ASSERT_EQ(result.code, 0) << result.error;
  int rules = 0;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);)  // a comment, or conditions and assignments
    if (!line.starts_with('#')) {
      ++rules;
      EXPECT_TRUE(line.starts_with("SUBSYSTEM==\"tty\", ")) << line;
      EXPECT_NE(line.find("TAG+=\"uaccess\""), std::string::npos) << line;
    }
  EXPECT_EQ(rules, 1);
}

class Audit : public OnSimulatedData {
 protected:
  static ProcessResult train(const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> all{"--data",   path("data"), "--out",    path(out), "--timesteps", "32",
                                 "--latent", "3",          "--scale",  "2",       "--batch",     "8",
                                 "--stride", "8",          "--epochs", "4",       "--ledger",    "2"};
    all.insert(all.end(), more.begin(), more.end());
    return run_process("supertac-train", all);
  }
  static ProcessResult audit(const std::string& model, const char* segments) {
    return run_process("supertac-check",
                       {"training", path(model), "--data", path("data"), "--segments", segments});
  }
  static void edit(const std::string& name, const std::function<void(std::string&)>& change) {
    std::string text = bytes(name);
    change(text);
    write_file(path(name), text);
  }
};

TEST_F(Audit, AModelSaysWhatItWasMadeFrom) {
  ASSERT_EQ(train("made.safetensors", {"--seed", "3", "--threads", "1"}).code, 0);
  const auto info = run_process("supertac-info", {path("made.safetensors"), "--json", "-"});
  const auto card = nlohmann::json::parse(info.out);
  const auto provenance = card["metadata"]["provenance"];
  EXPECT_EQ(provenance["command"],
            "supertac-train --epochs 4 --batch 8 --timesteps 32 --scale 2 --stride 8 --latent 3");
  EXPECT_EQ(provenance["seed"], "3");
  EXPECT_EQ(provenance["parents"]["recordings"].get<std::string>().size(), 64U);
  EXPECT_GT(card["run"]["seconds"], 0);
  const auto folder = nlohmann::json::parse(run_process("supertac-info", {path("data"), "--json", "-"}).out);
  EXPECT_EQ(folder["content"], provenance["parents"]["recordings"]);
  EXPECT_NE(folder["provenance"][0]["command"].get<std::string>().find("supertac-simulate"),
            std::string::npos);

  EXPECT_EQ(run_process("supertac-check", {"file", path("made.safetensors"), path("data")}).code, 0);
  std::filesystem::copy(path("data"), path("fewer"));
  std::filesystem::remove(list_recordings(path("fewer")).front());
  const auto other = run_process("supertac-check", {"file", path("made.safetensors"), path("fewer")});
  EXPECT_EQ(other.code, 1);
  EXPECT_NE(other.out.find("NOT made from"), std::string::npos) << other.out;
}

TEST_F(Audit, APartThatIsRepeatedGivesTheLedgersLines) {
  ASSERT_EQ(train("kept.safetensors").code, 0);
  const auto all = audit("kept.safetensors", "1000");
  EXPECT_EQ(all.code, 0) << all.out << all.error;
  const auto one = audit("kept.safetensors", "1");
  EXPECT_NE(one.out.find("\n1 of "), std::string::npos) << one.out;

  // A state is exchanged for that of another training.
  ASSERT_EQ(train("other.safetensors", {"--learning-rate", "0.0009"}).code, 0);
  const auto two = run_process("supertac-check",
                               {"ledgers", path("kept.run/ledger.jsonl"), path("other.run/ledger.jsonl")});
  EXPECT_EQ(two.code, 1);
  EXPECT_NE(two.out.find("differs between steps 1 and 2: encoder.0.conv.0.weight"), std::string::npos)
      << two.out;
  std::filesystem::copy(path("other.safetensors"), path("kept.safetensors"),
                        std::filesystem::copy_options::overwrite_existing);
  const auto changed = audit("kept.safetensors", "1");
  EXPECT_EQ(changed.code, 1) << changed.out;
}

TEST_F(Audit, TheGraphOfATrainingStepHasEveryParametersGradient) {
  ASSERT_EQ(train("graphed.safetensors").code, 0);
  const auto result = run_process(
      "supertac-explain", {path("graphed.safetensors"), "--recording", list_recordings(path("data")).front(),
                           "--at", "4", "--out", path("step.dot")});
  ASSERT_EQ(result.code, 0) << result.error;
  const std::string dot = bytes("step.dot");
  EXPECT_NE(result.out.find("step.dot: the graph of a training step\n"), std::string::npos) << result.out;
  for (const char* text : {"encoder.0.conv.0.weight [3,4,16] |value| ", "upsampler.out.bias [1] value ",
                           " us forward, ", " us back", "|y| ", "|g| ", " kB"})
    EXPECT_NE(dot.find(text), std::string::npos) << text << dot.substr(0, 2000);
}

TEST_F(Audit, TheGraphOfAnExpressionHasValuesAndGradients) {
  const auto draw = [](const std::string& text) {
    return run_process("supertac-explain", {text, "--out", path("expression.dot"), "--force"});
  };
  const auto result = draw("a=2; b=-3; relu(a*b+10)");
  ASSERT_EQ(result.code, 0) << result.error;
  const std::string dot = bytes("expression.dot");
  for (const char* text :
       {"a [] value 2  g -3", "b [] value -3  g 2", "10 [] value 10  g 1", "relu []", "y 4  g 1"})
    EXPECT_NE(dot.find(text), std::string::npos) << text << dot;
  EXPECT_NE(draw("a=2; a*c").error.find("expected a number, a name that has one, relu( or sigmoid( at 'c'"),
            std::string::npos);
  EXPECT_NE(result.out.find("expression.dot: the graph of the expression\n"), std::string::npos)
      << result.out;
  for (const char* divided : {"a=2; a/2", "a=2; b=3; relu(a)/b"})
    EXPECT_NE(draw(divided).error.find("expected +, -, * or the end at '/"), std::string::npos) << divided;
  EXPECT_NE(draw("a/2").error.find("a/2 is no file, and no expression, which has one of + * ( ) ="),
            std::string::npos);
  for (const char* negated : {"a=2; -a", "a=2; 3*-(a+1)"})
    EXPECT_NE(draw(negated).error.find("a minus stands before a number, or between two parts (0 - a) at '-"),
              std::string::npos)
        << negated;
  EXPECT_NE(draw("(1+2").error.find("expected ) at ''"), std::string::npos);
  EXPECT_EQ(draw("1 + 2 3").code, 2);
}

// The picture of lesson 3 was drawn by the command of its page: every line of its boxes is one of the
// graph's.
TEST_F(Audit, TheTapeOfTheLessonIsDrawnAsToday) {
  const std::string page = read_text_file(SUPERTAC_SOURCE "/docs/lessons/03_chain_rule.md", 1 << 20);
  std::string svg = read_text_file(SUPERTAC_SOURCE "/docs/pictures/tape.svg", 1 << 20);
  svg = std::regex_replace(std::regex_replace(svg, std::regex("&#160;"), " "), std::regex("&#45;"), "-");
  std::smatch command;
  ASSERT_TRUE(std::regex_search(page, command, std::regex("supertac-explain \"([^\"]+)\" --out tape.svg")));
  ASSERT_EQ(run_process("supertac-explain", {command[1], "--out", path("tape.dot")}).code, 0);
  const std::string dot = bytes("tape.dot");
  std::size_t boxes = 0;
  for (std::size_t at = 0; (at = dot.find("label=\"", at)) != std::string::npos; ++boxes) {
    at += 7;
    std::string label = dot.substr(at, dot.find('"', at) - at);
    for (std::size_t end = 0; end != std::string::npos;
         label.erase(0, end == std::string::npos ? end : end + 2)) {
      end = label.find("\\n");
      EXPECT_NE(svg.find(">" + label.substr(0, end) + "<"), std::string::npos) << label.substr(0, end);
    }
  }
  EXPECT_EQ(boxes, 4U);
}

TEST_F(Audit, NamesMayHoldSpaces) {
  const std::string plate = path("my plate.stl"), data = path("my data");
  write_file(plate, stl_bytes(mesh_of(Plate::named("6_Bumps"), {.resolution_mm = 1}), "6_Bumps"));
  const auto felt =
      run_process("supertac-simulate", {"--out", data, "--plates", plate, "--speeds", "10", "--passes", "1"});
  ASSERT_EQ(felt.code, 0) << felt.error;
  const auto made = run_process(
      "supertac-train", {"--data", data, "--out", path("my model.safetensors"), "--plates", "my plate.stl",
                         "--preset", "tiny", "--stride", "64", "--epochs", "1", "--ledger", "1"});
  ASSERT_EQ(made.code, 0) << made.error;
  const auto checked =
      run_process("supertac-check", {"training", path("my model.safetensors"), "--data", data});
  EXPECT_EQ(checked.code, 0) << checked.out << checked.error;
}

TEST_F(Audit, ALedgerThatWasChangedIsRefused) {
  ASSERT_EQ(train("told.safetensors").code, 0);
  edit("told.run/ledger.jsonl", [](std::string& text) {
    const std::size_t at = text.find("\"batches\":\"", text.size() / 2) + 11;
    text[at] = text[at] == '0' ? '1' : '0';
  });
  const auto result = audit("told.safetensors", "1");
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.error.find("the chain is broken"), std::string::npos) << result.error;
}

// Two trainings of the same recordings by recipes that differ in one number.
TEST_F(Audit, TwoTrainingsPartAtAnOperator) {
  ASSERT_EQ(train("first.safetensors").code, 0);
  ASSERT_EQ(train("second.safetensors", {"--beta", "0.002"}).code, 0);
  const auto compare = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"ledgers", path("first.run/ledger.jsonl"),
                                   path("second.run/ledger.jsonl")};
    words.insert(words.end(), more.begin(), more.end());
    return run_process("supertac-check", words);
  };
  const auto parted = compare({"--data", path("data"), "--out", path("parted.safetensors")});
  EXPECT_EQ(parted.code, 1) << parted.error;
  EXPECT_TRUE(std::regex_search(parted.out, std::regex("step 1, 0/[0-9]+\\.scale, the settings")))
      << parted.out;
  EXPECT_EQ(compare({}).code, 1);

  // The same step of both, each opened for itself.
  for (const std::string name : {"first", "second"})
    ASSERT_EQ(run_process("supertac-check", {"step", path(name + ".safetensors"), "--data", path("data"),
                                             "--at", "1", "--json", path(name + ".json")})
                  .code,
              0);
  const auto opened = run_process("supertac-check", {"ledgers", path("first.json"), path("second.json")});
  EXPECT_EQ(opened.code, 1);
  EXPECT_NE(opened.out.find("scale, the settings"), std::string::npos) << opened.out;
  const auto same = run_process("supertac-check", {"ledgers", path("first.json"), path("first.json")});
  EXPECT_EQ(same.code, 0) << same.error;

  // A training whose machine computed otherwise: from the states that it kept another line comes out here.
  std::filesystem::copy(path("first.run"), path("faulty.run"), std::filesystem::copy_options::recursive);
  std::filesystem::copy(path("second.run/ledger.jsonl"), path("faulty.run/ledger.jsonl"),
                        std::filesystem::copy_options::overwrite_existing);
  const auto faulty = run_process(
      "supertac-check",
      {"ledgers", path("first.run/ledger.jsonl"), path("faulty.run/ledger.jsonl"), "--data", path("data")});
  EXPECT_EQ(faulty.code, 1);
  EXPECT_NE(faulty.out.find("faulty.run/ledger.jsonl comes out otherwise here"), std::string::npos)
      << faulty.out;
  EXPECT_NE(faulty.out.find("open this step there, too"), std::string::npos) << faulty.out;
}

// Every operator of a step once more by NumPy, to the bit, and one of which a bit was changed.
TEST_F(Audit, ARefereeComputesAStepAgain) {
  ASSERT_EQ(train("judged.safetensors", {"--batch", "32"}).code, 0);
  const auto open = [&](const std::string& name, const std::string& out) {
    return run_process("supertac-check", {"step", path("judged.safetensors"), "--data", path("data"), "--at",
                                          "3", "--operator", name, "--out", out});
  };
  EXPECT_EQ(open("9/", path("none.safetensors")).code, 2);
  if (std::system(SUPERTAC_PYTHON " -c 'import numpy' 2>/dev/null") != 0)
    GTEST_SKIP() << "there is no Debian Python with NumPy here";
  const auto judge = [&](const std::string& file) {
    const std::string command = SUPERTAC_PYTHON " " SUPERTAC_SOURCE "/examples/referee.py " + file + " > " +
                                path("judged.txt") + " 2>&1";
    return std::system(command.c_str());
  };
  for (const std::string name : {"0/", "7/", "sum/", "norm", "update/"}) {
    const std::string file = path("judged_" + name.substr(0, 1) + ".safetensors");
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
  EXPECT_NE(judge(path("wrong.safetensors")), 0);
  EXPECT_NE(bytes("judged.txt").find("(conv_transpose2d), output 0: 1 of "), std::string::npos)
      << bytes("judged.txt");
  EXPECT_NE(bytes("judged.txt").find("first [0, 0, 0, 5]"), std::string::npos) << bytes("judged.txt");
  const std::string command = SUPERTAC_PYTHON " " SUPERTAC_SOURCE "/examples/verify_ledger.py " +
                              path("judged.run") + " > " + path("verified.txt");
  EXPECT_EQ(std::system(command.c_str()), 0) << bytes("verified.txt");
}

// Every step from volts to pixels, once more by NumPy; without it there is nothing to compare with.
TEST_F(Audit, AnExplainedPictureIsComputedAgain) {
  ASSERT_EQ(train("drawn.safetensors").code, 0);
  const std::string out = path("explained.safetensors");
  const auto result =
      run_process("supertac-explain", {path("drawn.safetensors"), "--recording",
                                       list_recordings(path("data")).front(), "--at", "4", "--out", out});
  ASSERT_EQ(result.code, 0) << result.error;
  EXPECT_GT(SafetensorsFile::read(out).tensors().size(), 30U);
  if (std::system(SUPERTAC_PYTHON " -c 'import numpy' 2>/dev/null") != 0)
    GTEST_SKIP() << "there is no Debian Python with NumPy here";
  const std::string command = SUPERTAC_PYTHON " " SUPERTAC_SOURCE "/examples/recompute.py " + out + " " +
                              path("drawn.safetensors") + " > " + path("recomputed.txt");
  EXPECT_EQ(std::system(command.c_str()), 0) << bytes("recomputed.txt");
  std::istringstream lines(bytes("recomputed.txt"));
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, std::regex("^[0-9]+\\."))) {
      EXPECT_TRUE(line.ends_with(" 100 %")) << "other bits: " << line;
    }
  }
}

}  // namespace
}  // namespace supertac
