#include <gtest/gtest.h>

#include "apps/common/command_line/arguments.h"
#include "apps/common/command_line/command_words.h"
#include "apps/common/command_line/nearest.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/threads.h"
#include "io/files/file.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

Arguments parsed(std::vector<const char*> words) {
  Arguments arguments("supertac-test", "Tests.");
  arguments.positional("FILE", "a file")
      .option("count", "N", "how many", "3")
      .option("list", "A,B", "some")
      .option("kind", "NAME", "one of two", "ridges");
  words.insert(words.begin(), "supertac-test");
  arguments.parse(static_cast<int>(words.size()), words.data());
  return arguments;
}

std::string message_of(const auto& action) {
  try {
    action();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(Arguments, DefaultsAndValues) {
  const Arguments bare = parsed({"x"});
  EXPECT_EQ(bare.text("FILE"), "x");
  EXPECT_EQ(bare.integer("count", 1, 9), 3);
  EXPECT_FALSE(bare.given("count"));
  EXPECT_TRUE(bare.list("list").empty());
  const Arguments full = parsed({"--count=5", "x", "--list", "1,2.5", "--quiet", "--kind", "bumps"});
  EXPECT_EQ(full.integer("count", 1, 9), 5);
  EXPECT_EQ(full.numbers("list", 0, 10), (std::vector<double>{1, 2.5}));
  EXPECT_TRUE(full.quiet());
  EXPECT_FALSE(full.force());
  EXPECT_EQ(full.choice("kind", {"ridges", "bumps"}), "bumps");
}

TEST(Arguments, MistakesAreNamed) {
  EXPECT_EQ(message_of([] { parsed({}); }), "missing FILE: a file");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--cuont", "3"});
            }),
            "unknown option '--cuont'; did you mean '--count'?");
  EXPECT_EQ(message_of([] { parsed({"x", "--zzzzzz"}); }), "unknown option '--zzzzzz'");
  EXPECT_EQ(message_of([] { parsed({"x", "y"}); }), "unexpected argument 'y'");
  EXPECT_NE(message_of([] { parsed({"x", "--count"}); }), "nothing thrown");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--count", "12"}).integer("count", 1, 9);
            }),
            "--count: expected a whole number from 1 to 9, found '12'");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--list", "1,nan"}).numbers("list", 0, 9);
            }),
            "--list: expected numbers from 0 to 9, found 'nan'");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--list", "1,,2"}).list("list");
            }),
            "--list: expected a list without empty elements, found '1,,2'");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--list", "1,"}).list("list");
            }),
            "--list: expected a list without empty elements, found '1,'");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--list", "1,1"}).list("list");
            }),
            "--list: expected every element once, found '1,1'");
  EXPECT_EQ(message_of([] {
              parsed({"x", "--kind", "bumbs"}).choice("kind", {"ridges", "bumps"});
            }),
            "--kind: expected one of ridges, bumps, found 'bumbs'; did you mean 'bumps'?");
}

TEST(Arguments, HelpShowsUnitsAndDefaultsAndNeedsNothing) {
  const std::string help = parsed({"--help"}).help();
  for (const char* text : {"FILE", "--count N", "(default: 3)", "--json FILE", "--threads N"}) {
    EXPECT_NE(help.find(text), std::string::npos) << text;
  }
}

TEST(Nearest, NamesWhatWasMeantOrNothing) {
  const std::vector<std::string> names = {"seed", "speeds", "trials", "threads"};
  EXPECT_EQ(nearest_name("sede", names), "seed");
  EXPECT_EQ(nearest_name("speed", names), "speeds");
  EXPECT_EQ(nearest_name("thread", names), "threads");
  EXPECT_EQ(nearest_name("epochs", names), "");
  EXPECT_EQ(nearest_name("", names), "");
}

TEST(Threads, QuotaOfACgroup) {
  EXPECT_EQ(quota_of_cpu_max("200000 100000"), 2);
  EXPECT_EQ(quota_of_cpu_max("150000 100000"), 2);
  EXPECT_EQ(quota_of_cpu_max("1000 100000"), 1);
  for (const char* text : {"max 100000", "", "5", "0 100000", "100000 0", "-1 100000"}) {
    EXPECT_EQ(quota_of_cpu_max(text), std::nullopt) << text;
  }
  EXPECT_GE(default_threads(), 1);
}

TEST(Progress, LineTellsShareRateAndTimeLeft) {
  EXPECT_EQ(progress_line("training", 50, 200, "steps", 5),
            "training  [######..................]  25 %  5.0 steps/s  0:30 left");
  EXPECT_EQ(progress_line("x", 0, 0, "steps", 0), "x  [........................]  0 %  0.0 steps/s");
  EXPECT_NE(progress_line("x", 1, 10'000, "steps", 1).find("2:46:39 left"), std::string::npos);
  EXPECT_EQ(progress_line("x", 50, 200, "steps", 5, "epoch 1/4"),
            "x  [##........]  25 %  epoch 1/4  0:30 left");
}

TEST(Progress, SaysAboutHowLong) {
  EXPECT_EQ(about(38), "40 seconds");
  EXPECT_EQ(about(700), "12 minutes");
  EXPECT_EQ(about(9000), "2.5 hours");
}

TEST(CommandWords, AreTheSameAgain) {
  const std::vector<std::string> words = {"supertac-train", "--data", "my data", "", "it's", "a\\b", "x,y=1"};
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + quoted_word(word);
  EXPECT_EQ(command_words(line), words) << line;
  EXPECT_EQ(quoted_word("plain-word_1.5"), "plain-word_1.5");
  EXPECT_THROW(command_words("a 'b"), std::invalid_argument);
}

TEST(OutputFolder, RemovesWhatItMadeUnlessKept) {
  TemporaryFolder folder;
  {
    OutputFolder output(folder.file("a/b"), false);
    write_file(output.add("x"), "x");
  }
  EXPECT_EQ(folder.entries(), 0u);
  {
    OutputFolder output(folder.file("a/b"), false);
    write_file(output.add("x"), "x");
    EXPECT_FALSE(std::filesystem::exists(folder.file("a/b"))) << "half a folder is seen";
    output.keep();
    EXPECT_TRUE(std::filesystem::exists(folder.file("a/b/x")));
  }
  {
    OutputFolder output(folder.file("a/b"), true);
    write_file(output.add("x"), "new");
    write_file(output.add("y"), "y");
    EXPECT_THROW(OutputFolder(folder.file("a/b"), false).add("x"), FileError);
  }
  EXPECT_TRUE(std::filesystem::exists(folder.file("a/b/x")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("a/b/y")));
}

TEST(OutputFolder, WhatAKilledProgramLeftIsNotKept) {
  TemporaryFolder folder;
  std::filesystem::create_directories(folder.file(".a.unfinished"));
  write_file(folder.file(".a.unfinished/old"), "of a program that was killed");
  OutputFolder output(folder.file("a/"), false);
  write_file(output.add("new"), "");
  output.keep();
  EXPECT_FALSE(std::filesystem::exists(folder.file("a/old")));
  EXPECT_TRUE(std::filesystem::exists(folder.file("a/new")));
}

}  // namespace
}  // namespace supertac
