// Nothing lost, nothing obeyed, nothing hung: real programs in real processes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "apps/common/command_line/arguments.h"
#include "apps/common/output/outputs.h"
#include "io/files/file.h"
#include "io/files/folder_lock.h"
#include "tests/apps/common/process.h"
#include "tests/sanitized.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

std::string text_of(const std::string& path) { return read_text_file(path, 1 << 24); }

const std::vector<std::string> kSimulate = {"--plates", "plain", "--speeds", "10",
                                            "--trials", "1",     "--passes", "2"};

ProcessResult simulate(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), kSimulate.begin(), kSimulate.end());
  return run_process("supertac-simulate", arguments);
}

TEST(Outputs, TwoOfThemAreNeverOneFile) {
  const TemporaryFolder folder;
  write_file(folder / "old", "old");
  fs::create_hard_link(folder / "old", folder / "hard");
  fs::create_symlink("old", folder / "soft");
  for (const char* other : {"old", "./old", "hard", "soft"}) {
    const auto result = run_process(
        "supertac-plate", {"--plate", "plain", "--out", folder / "old", "--json", folder / other, "--force"});
    EXPECT_EQ(result.code, 2) << other;
    EXPECT_NE(result.error.find("would overwrite the output of --"), std::string::npos) << result.error;
  }
  const auto fresh =
      run_process("supertac-plate", {"--plate", "plain", "--out", folder / "m", "--gcode", folder / "./m"});
  EXPECT_EQ(fresh.code, 2) << "a name that does not exist yet";
  EXPECT_EQ(text_of(folder / "old"), "old");
}

TEST(Outputs, AnInputIsNeverOverwritten) {
  const TemporaryFolder folder;
  ASSERT_EQ(
      run_process("supertac-plate", {"--plate", "ridges6", "--out", folder / "mine.stl", "--resolution", "5"})
          .code,
      0);
  const std::string before = text_of(folder / "mine.stl");
  const auto plate = run_process("supertac-plate",
                                 {"--plate", folder / "mine.stl", "--out", folder / "mine.stl", "--force"});
  EXPECT_EQ(plate.code, 2) << plate.error;
  EXPECT_NE(plate.error.find("would overwrite the input of --plate"), std::string::npos) << plate.error;
  EXPECT_EQ(text_of(folder / "mine.stl"), before);
  ASSERT_EQ(simulate({"--out", folder / "data"}).code, 0);
  const std::string recording = fs::directory_iterator(folder / "data")->path();
  const auto train =
      run_process("supertac-train", {"--data", folder / "data", "--out", recording, "--force"});
  EXPECT_EQ(train.code, 2) << train.error;
  EXPECT_NE(train.error.find("would overwrite the input of --data"), std::string::npos) << train.error;
}

TEST(Outputs, AreFoundUnusableBeforeTheWork) {
  const TemporaryFolder folder;
  ASSERT_EQ(simulate({"--out", folder / "data"}).code, 0);
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0600), 0);
  fs::create_directory(folder / "dir");
  const std::string long_name(250, 'x');
  for (const std::string& bad :
       {folder / "m.run", folder / "dir", folder / "fifo", folder / long_name, folder / "no/such/m"}) {
    for (const bool json : {false, true}) {
      if (json && bad.ends_with(".run")) continue;  // a good name for JSON
      const std::vector<std::string> arguments = {"--data",
                                                  folder / "data",
                                                  "--epochs",
                                                  "1000",
                                                  "--force",
                                                  "--split",
                                                  "window",
                                                  "--out",
                                                  json ? folder / "model" : bad,
                                                  "--json",
                                                  json ? bad : folder / "json"};
      const auto result = run_process("supertac-train", arguments);
      EXPECT_EQ(result.code, 1) << bad << result.error;
      EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
      EXPECT_FALSE(fs::exists(folder / "model.run")) << "found after training had begun";
    }
  }
}

TEST(Outputs, ASecondWriterOfAFolderIsRefused) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "out");
  const pid_t holder = fork();
  if (holder == 0) {
    const FolderLock lock(folder / "out");
    write_file(folder / "held", "");
    pause();
  }
  wait_for_file(folder / "held");
  const auto second = simulate({"--out", folder / "out"});
  kill(holder, SIGKILL);
  waitpid(holder, nullptr, 0);
  EXPECT_EQ(second.code, 1);
  EXPECT_NE(second.error.find("another program is writing there"), std::string::npos) << second.error;
  EXPECT_EQ(simulate({"--out", folder / "out"}).code, 0) << "a killed program holds nothing";
}

// Whatever appears while a program works stays, and so does the program's work.
TEST(Outputs, WhatAppearsMeanwhileIsNotReplaced) {
  const TemporaryFolder folder;
  ASSERT_EQ(simulate({"--out", folder / "data"}).code, 0);
  const std::vector<std::string> names = {"model.safetensors", "json.json"};
  RunningProcess train("supertac-train",
                       {"--data", folder / "data", "--split", "window", "--preset", "tiny", "--epochs", "1",
                        "--out", folder / names[0], "--json", folder / names[1]});
  wait_for_file(folder / "model.run/settings.json");
  for (const std::string& name : names) write_file(folder / name, "precious");
  const ProcessResult result = train.wait();
  EXPECT_EQ(result.code, 1) << result.error;
  for (const std::string& name : names) {
    const std::string other = fs::path(name).stem().string() + "-2" + fs::path(name).extension().string();
    EXPECT_EQ(text_of(folder / name), "precious");
    EXPECT_TRUE(fs::exists(folder / other)) << other;
    EXPECT_NE(result.error.find(folder / other), std::string::npos) << result.error;
  }
  EXPECT_NE(result.out.find(folder / "model-2.safetensors"), std::string::npos) << result.out;
}

TEST(Outputs, EmptyNamesAreRefused) {
  for (const auto& [program, option] :
       {std::pair{"supertac-plate", "--json"}, {"supertac-train", "--resume"}}) {
    const auto result = run_process(program, {"--plate", "plain", "--out", "x", option, ""});
    EXPECT_EQ(result.code, 2);
  }
  const auto resume = run_process("supertac-train", {"--data", "x", "--out", "x", "--resume", ""});
  EXPECT_NE(resume.error.find("--resume: expected FILE, found an empty name"), std::string::npos)
      << resume.error;
}

/// Runs a shell line with $BIN: only what a test needs a shell for.
int shell(const std::string& line) {
  const int status = std::system(("BIN=" SUPERTAC_BIN "; " + line).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

TEST(Descriptors, ClosedOnesGoToNobody) {
  const TemporaryFolder folder;
  const std::string out = folder / "x.stl";
  EXPECT_EQ(shell("$BIN/supertac-plate --plate plain --resolution 5 --out " + out + " <&- >&- 2>&-"), 0);
  const std::string stl = text_of(out);
  EXPECT_EQ(stl.find("triangles"), std::string::npos) << "a message was written into the file";
  EXPECT_EQ((stl.size() - 84) % 50, 0U);
}

TEST(Pipes, AReaderThatGoesAwayCostsNoFile) {
  const TemporaryFolder folder;
  shell("$BIN/supertac-simulate --plates plain --speeds 10 --trials 1 --passes 8 --json - --out " +
        (folder / "d") + " | true");
  for (int pass = 1; pass <= 8; ++pass)
    EXPECT_TRUE(fs::exists(folder / ("d/plain_t1_p" + std::to_string(pass) + "_v10.safetensors"))) << pass;
}

TEST(Pipes, AReaderThatHasEnoughHearsNothing) {
  const TemporaryFolder folder;
  ASSERT_EQ(simulate({"--out", folder / "data"}).code, 0);
  // The reader is gone before anything is written.
  shell("( sleep 1; $BIN/supertac-info " + (folder / "data/plain_t1_p1_v10.safetensors") + " 2>" +
        (folder / "error") + "; echo $? >" + (folder / "new") + "; mv " + (folder / "new") + " " +
        (folder / "code") + " ) | true");
  wait_for_file(folder / "code");
  EXPECT_EQ(text_of(folder / "error"), "");
  EXPECT_EQ(text_of(folder / "code"), "141\n");
  EXPECT_EQ(shell("$BIN/supertac-info --help >/dev/full 2>" + (folder / "error")), 1);
  EXPECT_NE(text_of(folder / "error").find("is the disk full?"), std::string::npos);
}

TEST(Errors, AreOneClearLine) {
  const TemporaryFolder folder;
  fs::create_symlink("loop", folder / "loop");
  const std::string odd = folder / "na\xff\x1b[31mme";
  const std::string huge(5000, 'x');
  for (const std::string& name : {folder / "loop", odd, huge, folder / "loop/x"}) {
    for (const std::vector<std::string>& arguments :
         {std::vector<std::string>{"supertac-info", name},
          {"supertac-simulate", "--out", name, "--plates", name},
          {"supertac-import", name, "--out", folder / "o"},
          {"supertac-import", "--journal", name, "--out", folder / "o"},
          {"supertac-plate", "--plate", name, "--out", folder / "p"},
          {"supertac-plate", "--plate", "plain", "--json", name},
          {"supertac-sweep", "--out", name},
          {"supertac-evaluate", "--model", name, "--data", name},
          {"supertac-stream", "--model", name, "--recording", name},
          {"supertac-train", "--data", name, "--out", folder / "m"}}) {
      const auto result = run_process(arguments[0], {arguments.begin() + 1, arguments.end()});
      EXPECT_TRUE(result.code == 1 || result.code == 2) << arguments[0] << result.code;
      EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
      for (const char* raw : {"filesystem error", "[json.", "std::", "\x1b", "basic_"})
        EXPECT_EQ((result.error + result.out).find(raw), std::string::npos) << result.error;
    }
  }
}

// The most memory that a program of this test has held so far, in kB.
long most_kilobytes() {
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  return used.ru_maxrss;
}

TEST(Errors, EvilValuesAreOneClearLineAtOnce) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0600), 0);
  const std::string out = folder / "out";
  struct Evil {
    std::vector<std::string> words;
    std::string said;
  };
  for (const auto& [words, said] :
       {Evil{{"supertac-import", "--journal", folder / "fifo", "--out", out}, "is not a regular file"},
        Evil{{"supertac-import", "--journal", "/dev/zero", "--out", out}, "is not a regular file"},
        Evil{{"supertac-classify", "--model", "none", "--data", folder.path(), "--views", ""}, "found none"},
        Evil{{"supertac-plate", "--plate", "ridges0.0000001", "--out", out}, "from 0.05 to 1000 mm"},
        Evil{{"supertac-plate", "--plate", "ridgesinf", "--out", out}, "from 0.05 to 1000 mm"},
        Evil{{"supertac-simulate", "--plates", "ridges0.0000001", "--out", out}, "from 0.05 to 1000 mm"},
        Evil{{"supertac-train", "--data", folder.path(), "--out", out, "--resume", ""},
             "found an empty name"}}) {
    const auto result = run_process(words[0], {words.begin() + 1, words.end()});
    EXPECT_TRUE(result.code == 1 || result.code == 2) << words[0] << ' ' << words[2] << result.code;
    EXPECT_NE(result.error.find(said), std::string::npos) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
    EXPECT_FALSE(fs::exists(out)) << words[0] << ' ' << words[2];
  }
  EXPECT_LT(most_kilobytes(), 1'000'000);
}

// Batch systems, containers and odd shells grant little: one line, and an end.
TEST(Limits, AreOneClearLineAtOnce) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer needs terabytes of addresses";
  const TemporaryFolder folder;
  ASSERT_EQ(simulate({"--out", folder / "data"}).code, 0);
  ASSERT_EQ(run_process("supertac-train", {"--data", folder / "data", "--split", "window", "--preset", "tiny",
                                           "--epochs", "1", "--out", folder / "m"})
                .code,
            0);
  const std::string evaluate =
      "timeout -k 1 60 $BIN/supertac-evaluate --split none --limit 20 --quiet --model " + (folder / "m") +
      " --data " + (folder / "data");
  const auto lines = [&](const std::string& limits, const std::string& more) {
    const int code = shell(limits + "; " + evaluate + more + " >/dev/null 2>" + (folder / "error"));
    const std::string error = text_of(folder / "error");
    EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), code) << limits << code << error;
    EXPECT_EQ(error.find("bad_alloc"), std::string::npos) << error;
    return error;
  };
  for (const char* kilobytes : {"60000", "100000", "160000"})
    lines("ulimit -v " + std::string(kilobytes), " --threads 1");
  EXPECT_NE(lines("ulimit -v 100000", " --threads 64").find("cannot start 64 threads"), std::string::npos);
  EXPECT_NE(lines("ulimit -s 128", "").find("ulimit -s 8192"), std::string::npos);
  EXPECT_NE(lines("export OMP_STACKSIZE=16k", "").find("expected at least 64k"), std::string::npos);
}

TEST(Import, HoldsOnePlateAtATime) {
  const TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 4000; ++i)
    for (int k = 0; k < 16; ++k)
      text += std::to_string(2.4 - 0.1 * std::abs(std::sin(0.01 * i + k))) + (k < 15 ? ' ' : '\n');
  long one = 0;
  for (const char* plate : {"6_Ridges", "4_Ridges", "3_Bumps", "6_Bumps", "4_Blob", "6_Blob"}) {
    for (const char* trial : {"1", "2"}) {
      fs::create_directories(folder / ("texts/" + std::string(plate) + "/" + trial));
      for (const char* pass : {"1", "2", "3", "4"})
        write_file(folder / ("texts/" + std::string(plate) + "/" + trial + "/" + pass + ".txt"), text);
    }
    if (one > 0) continue;
    ASSERT_EQ(run_process("supertac-import", {folder / "texts", "--skip-bad", "--out", folder / "one"}).code,
              0);
    one = most_kilobytes();
  }
  const auto all = run_process("supertac-import", {folder / "texts", "--skip-bad", "--out", folder / "all"});
  ASSERT_EQ(all.code, 0) << all.error;
  EXPECT_TRUE(kSanitized || most_kilobytes() < one + one / 4) << most_kilobytes() << " kB, one plate " << one;
}

// An output in a folder that is called like a plate or a preset replaces no input.
TEST(Outputs, InAFolderOfAPlatesNameReplaceNoInput) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "bumps6");
  write_file(folder / "bumps6/plate.stl", std::string("old"));
  EXPECT_EQ(shell("cd " + folder.path() +
                  " && $BIN/supertac-plate --plate bumps6 --resolution 5 --out bumps6/plate.stl --force"),
            0);
}

}  // namespace
}  // namespace supertac
