// Nothing lost, nothing obeyed, nothing hung: real programs in real processes.
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "apps/common/command_line/arguments.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/sanitized.h"
#include "tests/support/test.h"

namespace supertac::hostile_test {

namespace fs = std::filesystem;

using Descriptors = ProgramTest;
using Errors = ProgramTest;
using Import = ProgramTest;
using Limits = ProgramTest;
using Outputs = ProgramTest;
using Pipes = ProgramTest;

const std::string kSimulate = "supertac-simulate --plates plain --speeds 10 --trials 1 --passes 2 --out ";

TEST_F(Outputs, TwoOfThemAreNeverOneFile) {
  write_file(path("old"), "old");
  fs::create_hard_link(path("old"), path("hard"));
  fs::create_symlink("old", path("soft"));
  for (const std::string other : {"old", "./old", "hard", "soft"})
    expect_exit(run("supertac-plate --plate plain --out old --force --json " + other), 2,
                "would overwrite the output of --");
  const auto fresh = run("supertac-plate --plate plain --out m --json ./m");
  EXPECT_EQ(fresh.code, 2) << "a name that does not exist yet";
  EXPECT_EQ(bytes("old"), "old");
}

TEST_F(Outputs, AnInputIsNeverOverwritten) {
  succeed("supertac-plate --plate ridges6 --out mine.stl");
  const std::string before = bytes("mine.stl");
  expect_exit(run("supertac-plate --plate mine.stl --out mine.stl --force"), 2,
              "would overwrite the input of --plate");
  EXPECT_EQ(bytes("mine.stl"), before);
  succeed(kSimulate + "data");
  const std::string recording = fs::directory_iterator(path("data"))->path();
  expect_exit(run("supertac-train --data data --out " + recording + " --force"), 2,
              "would overwrite the input of --data");
}

TEST_F(Outputs, AreFoundUnusableBeforeTheWork) {
  succeed(kSimulate + "data");
  ASSERT_EQ(mkfifo(path("fifo").c_str(), 0600), 0);
  fs::create_directory(path("dir"));
  for (const std::string& bad :
       {path("m.run"), path("dir"), path("fifo"), path(std::string(250, 'x')), path("no/such/m")}) {
    for (const bool json : {false, true}) {
      if (json && bad.ends_with(".run")) continue;  // a good name for JSON
      expect_failure(run("supertac-train --data data --epochs 1000 --force --split window --out " +
                         (json ? "model --json " + bad : bad + " --json json")),
                     1, "");
      EXPECT_FALSE(fs::exists(path("model.run"))) << "found after training had begun";
    }
  }
}

TEST_F(Outputs, ASecondWriterOfAFolderIsRefused) {
  fs::create_directory(path("out"));
  const pid_t holder = fork();
  if (holder == 0) {
    const FolderLock lock(path("out"));
    write_file(path("held"), "");
    pause();
  }
  wait_for_file(path("held"));
  const auto second = run(kSimulate + "out");
  kill(holder, SIGKILL);
  waitpid(holder, nullptr, 0);
  expect_exit(second, 1, "another program is writing there");
  succeed(kSimulate + "out");  // a killed program holds nothing
}

// Whatever appears while a program works stays, and so does the program's work.
TEST_F(Outputs, WhatAppearsMeanwhileIsNotReplaced) {
  succeed(kSimulate + "data");
  const std::vector<std::string> names = {"model.safetensors", "json.json"};
  RunningProcess train = start("supertac-train --data data --split window --preset tiny --epochs 1 --out " +
                               names[0] + " --json " + names[1]);
  wait_for_file(path("model.run/settings.json"));
  for (const std::string& name : names) write_file(path(name), "precious");
  const ProcessResult result = train.wait();
  EXPECT_EQ(result.code, 1) << result.error;
  for (const std::string& name : names) {
    const std::string other = fs::path(name).stem().string() + "-2" + fs::path(name).extension().string();
    EXPECT_EQ(bytes(name), "precious");
    EXPECT_TRUE(fs::exists(path(other))) << other;
    EXPECT_TRUE(contains(result.error, other));
  }
  EXPECT_TRUE(contains(result.out, "model-2.safetensors"));
}

TEST_F(Outputs, EmptyNamesAreRefused) {
  EXPECT_EQ(run_process("supertac-plate", {"--plate", "plain", "--out", "x", "--json", ""}).code, 2);
  expect_failure(run_process("supertac-train", {"--data", "x", "--out", "x", "--resume", ""}), 2,
                 "--resume: expected FILE, found an empty name");
}

/// Runs a shell line with $BIN: only what a test needs a shell for.
int shell(const std::string& line) {
  const int status = std::system(("BIN=" SUPERTAC_BIN "; " + line).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

TEST_F(Descriptors, ClosedOnesGoToNobody) {
  const std::string out = path("x.stl");
  EXPECT_EQ(shell("$BIN/supertac-plate --plate plain --out " + out + " <&- >&- 2>&-"), 0);
  const std::string stl = bytes("x.stl");
  EXPECT_FALSE(contains(stl, "triangles")) << "a message was written into the file";
  EXPECT_EQ((stl.size() - 84) % 50, 0U);
}

TEST_F(Pipes, AReaderThatGoesAwayCostsNoFile) {
  shell("$BIN/supertac-simulate --plates plain --speeds 10 --trials 1 --passes 8 --json - --out " +
        path("d") + " | true");
  for (int pass = 1; pass <= 8; ++pass)
    EXPECT_TRUE(fs::exists(path("d/plain_t1_p" + std::to_string(pass) + "_v10.safetensors"))) << pass;
}

TEST_F(Pipes, AReaderThatHasEnoughHearsNothing) {
  succeed(kSimulate + "data");
  // The reader is gone before anything is written.
  shell("( sleep 1; $BIN/supertac-info " + path("data/plain_t1_p1_v10.safetensors") + " 2>" + path("error") +
        "; echo $? >" + path("new") + "; mv " + path("new") + " " + path("code") + " ) | true");
  wait_for_file(path("code"));
  EXPECT_EQ(bytes("error"), "");
  EXPECT_EQ(bytes("code"), "141\n");
  EXPECT_EQ(shell("$BIN/supertac-info --help >/dev/full 2>" + path("error")), 1);
  EXPECT_TRUE(contains(bytes("error"), "is the disk full?"));
}

// The most memory that a program of this test has held so far, in kB.
long most_kilobytes() {
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  return used.ru_maxrss;
}

TEST_F(Errors, EvilValuesAreOneClearLineAtOnce) {
  ASSERT_EQ(mkfifo(path("fifo").c_str(), 0600), 0);
  for (const std::string file : {"fifo", "/dev/zero"})
    expect_failure(run("supertac-import --out out --journal " + file), 1, "is not a regular file");
  for (const std::string line :
       {"plate --plate ridges0.0000001", "plate --plate ridgesinf", "simulate --plates ridges0.0000001"})
    expect_failure(run("supertac-" + line + " --out out"), 2, "from 0.05 to 1000 mm");
  EXPECT_FALSE(fs::exists(path("out")));
  EXPECT_LT(most_kilobytes(), 1'000'000);
}

// Batch systems, containers and odd shells grant little: one line, and an end.
TEST_F(Limits, AreOneClearLineAtOnce) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer needs terabytes of addresses";
  succeed(kSimulate + "data");
  succeed("supertac-train --data data --split window --preset tiny --epochs 1 --out m");
  const std::string evaluate =
      "timeout -k 1 60 $BIN/supertac-evaluate --split none --limit 20 --quiet --model " + path("m") +
      " --data " + path("data");
  const auto lines = [&](const std::string& limits, const std::string& more) {
    const int code = shell(limits + "; " + evaluate + more + " >/dev/null 2>" + path("error"));
    const std::string error = bytes("error");
    EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), code) << limits << code << error;
    EXPECT_FALSE(contains(error, "bad_alloc"));
    return error;
  };
  for (const char* kilobytes : {"60000", "100000", "160000"})
    lines("ulimit -v " + std::string(kilobytes), " --threads 1");
  EXPECT_TRUE(contains(lines("ulimit -v 100000", " --threads 64"), "cannot start 64 threads"));
}

TEST_F(Import, HoldsOnePlateAtATime) {
  std::string text;
  for (int i = 0; i < 4000; ++i)
    for (int k = 0; k < 16; ++k)
      text += std::to_string(2.4 - 0.1 * std::abs(std::sin(0.01 * i + k))) + (k < 15 ? ' ' : '\n');
  long one = 0;
  for (const char* plate : {"6_Ridges", "4_Ridges", "3_Bumps", "6_Bumps", "4_Blob", "6_Blob"}) {
    for (const char* trial : {"1", "2"}) {
      fs::create_directories(path("texts/" + std::string(plate) + "/" + trial));
      for (const char* pass : {"1", "2", "3", "4"})
        write_file(path("texts/" + std::string(plate) + "/" + trial + "/" + pass + ".txt"), text);
    }
    if (one > 0) continue;
    succeed("supertac-import texts --skip-bad --out one");
    one = most_kilobytes();
  }
  succeed("supertac-import texts --skip-bad --out all");
  EXPECT_TRUE(kSanitized || most_kilobytes() < one + one / 4) << most_kilobytes() << " kB, one plate " << one;
}

// An output in a folder that is called like a plate or a preset replaces no input.
TEST_F(Outputs, InAFolderOfAPlatesNameReplaceNoInput) {
  fs::create_directory(path("bumps6"));
  write_file(path("bumps6/plate.stl"), std::string("old"));
  succeed("supertac-plate --plate bumps6 --out bumps6/plate.stl --force");
}

}  // namespace supertac::hostile_test
