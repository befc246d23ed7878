#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <thread>

#include "apps/common/command_line/arguments.h"
#include "apps/common/output/output_folder.h"
#include "apps/common/running/progress.h"
#include "apps/common/running/signals.h"
#include "io/files/file.h"
#include "tests/support/test.h"

namespace supertac::common_test {

namespace fs = std::filesystem;

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

std::string message_of(const auto& action) { return what_of<UsageError>(action); }

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
  const auto said_of = [](const std::vector<const char*>& words) {
    return message_of([&] {
      const Arguments given = parsed(words);
      given.integer("count", 1, 9), given.numbers("list", 0, 9), given.choice("kind", {"ridges", "bumps"});
    });
  };
  const std::pair<std::vector<const char*>, std::string> cases[] = {
      {{}, "missing FILE: a file"},
      {{"x", "--cuont", "3"}, "unknown option '--cuont'; did you mean '--count'?"},
      {{"x", "--coun", "3"}, "unknown option '--coun'; did you mean '--count'?"},
      {{"x", "--thread", "3"}, "unknown option '--thread'; did you mean '--threads'?"},
      {{"x", "--zzzzzz"}, "unknown option '--zzzzzz'"},
      {{"x", "--json", "--cuont"}, "unknown option '--cuont'; did you mean '--count'?"},
      {{"--x"}, "unknown option '--x'"},
      {{"--FILE", "x"}, "unknown option '--FILE'"},
      {{"y", "x", "--zzzzzz"}, "unknown option '--zzzzzz'"},
      {{"x", "y"}, "unexpected argument 'y'"},
      {{"x", "--count", "12"}, "--count: expected a whole number from 1 to 9, found '12'"},
      {{"x", "--list", "1,nan"}, "--list: expected numbers from 0 to 9, found 'nan'"},
      {{"x", "--list", "1,,2"}, "--list: expected a list without empty elements, found '1,,2'"},
      {{"x", "--list", "1,"}, "--list: expected a list without empty elements, found '1,'"},
      {{"x", "--list", " "}, "--list: expected a list without empty elements, found ' '"},
      {{"x", "--list", "1, "}, "--list: expected a list without empty elements, found '1, '"},
      {{"x", "--list", "1,1"}, "--list: expected every element once, found '1,1'"},
      {{"x", "--kind", "bumbs"},
       "--kind: expected one of ridges, bumps, found 'bumbs'; did you mean 'bumps'?"}};
  for (const auto& [words, said] : cases) EXPECT_EQ(said_of(words), said);
  EXPECT_NE(said_of({"x", "--count"}), "nothing thrown");
}

TEST(Arguments, HelpShowsUnitsAndDefaultsAndNeedsNothing) {
  const std::string help = parsed({"--help"}).help();
  for (const char* text : {"FILE", "--count N", "(default: 3)", "--json FILE", "--threads N"})
    EXPECT_NE(help.find(text), std::string::npos) << text;
}

TEST(Threads, QuotaOfACgroup) {
  EXPECT_EQ(quota_of_cpu_max("200000 100000"), 2);
  EXPECT_EQ(quota_of_cpu_max("150000 100000"), 2);
  EXPECT_EQ(quota_of_cpu_max("1000 100000"), 1);
  for (const char* text : {"max 100000", "", "5", "0 100000", "100000 0", "-1 100000"})
    EXPECT_EQ(quota_of_cpu_max(text), std::nullopt) << text;
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

TEST(TerminalLine, WaitsForNobody) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  const int before = dup(STDERR_FILENO);
  dup2(ends[0], STDERR_FILENO);
  {
    TerminalLine line;
    line.show("more");
    while (send(ends[0], "-", 1, MSG_DONTWAIT) == 1) continue;
    line.show("most");
  }
  dup2(before, STDERR_FILENO);
  char shown[6] = {};
  recv(ends[1], shown, 5, 0);
  EXPECT_STREQ(shown, "\rmore");
  for (const int end : {before, ends[0], ends[1]}) close(end);
}

// Not to be replaced; what was said of a name that was taken goes to `said`.
OutputPath new_at(const std::string& path, std::string& said) {
  return {path, [&said](const std::string& line) { said = line; }};
}

TEST(OutputFolder, RemovesWhatItMadeUnlessKept) {
  TemporaryFolder folder;
  std::string said;
  const OutputPath place = new_at(folder.file("a/b"), said);
  {
    OutputFolder output(place);
    write_file(output.add("x"), "x");
  }
  EXPECT_EQ(folder.entries(), 0u);
  {
    OutputFolder output(place);
    write_file(output.add("x"), "x");
    EXPECT_FALSE(fs::exists(folder.file("a/b"))) << "half a folder is seen";
    output.keep();
    EXPECT_TRUE(fs::exists(folder.file("a/b/x")));
  }
  {
    OutputFolder output(folder.file("a/b"));
    write_file(output.add("x"), "new");
    write_file(output.add("y"), "y");
    EXPECT_THROW(OutputFolder(place).add("x"), FileError);
  }
  EXPECT_EQ(read_text_file(folder.file("a/b/x"), 9), "x");
  EXPECT_FALSE(fs::exists(folder.file("a/b/y")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.file("a/b")), {}), 2) << "x, provenance.jsonl";
  EXPECT_EQ(said, "");
}

TEST(OutputFolder, WhatAKilledProgramLeftIsRemoved) {
  TemporaryFolder folder;
  const std::string left = folder.file(".a.unfinished-4194305-0");  // no process has this number
  fs::create_directories(left);
  write_file(left + "/old", "of a program that was killed");
  OutputFolder output(folder.file("a/"));
  EXPECT_FALSE(fs::exists(left));
  write_file(output.add("new"), "");
  output.keep();
  EXPECT_TRUE(fs::exists(folder.file("a/new")));
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(OutputFolder, NothingThatItHasNotMadeIsFollowedOrEmptied) {
  TemporaryFolder folder;
  fs::create_directories(folder.file("home"));
  write_file(folder.file("home/thesis"), "precious");
  const std::string own = std::to_string(::getpid());
  for (const std::string& name : {std::string(), std::string("-4194305-0"), "-" + own + "-0"})
    fs::create_symlink("home", folder.file(".a.unfinished" + name));
  write_file(folder.file(".a.unfinished-4194306-0"), "a file");
  fs::create_directories(folder.file(".b.unfinished"));
  write_file(folder.file(".b.unfinished/mine"), "precious");
  for (const char* name : {"a", "b"}) {
    OutputFolder output(folder.file(name));
    write_file(output.add("new"), "");
    output.keep();
    EXPECT_TRUE(fs::is_directory(fs::symlink_status(folder.file(name))));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.file("home")), {}), 1);
  EXPECT_EQ(read_text_file(folder.file("home/thesis"), 9), "precious");
  EXPECT_EQ(read_text_file(folder.file(".b.unfinished/mine"), 9), "precious");
}

TEST(OutputFolder, ANameThatWasTakenMeanwhileKeepsWhatItHolds) {
  TemporaryFolder folder;
  std::string said;
  {
    OutputFolder output(new_at(folder.file("a"), said));
    write_file(output.add("x"), "work");
    fs::create_directories(folder.file("a"));
    output.keep();
  }
  EXPECT_TRUE(fs::is_empty(folder.file("a")));
  EXPECT_EQ(read_text_file(folder.file("a-2/x"), 9), "work");
  EXPECT_NE(said.find(folder.file("a-2")), std::string::npos) << said;
  {
    OutputFolder output(new_at(folder.file("a"), said));
    write_file(output.add("x.txt"), "work");
    write_file(output.path() + "/plate.stl", "plate");
    write_file(folder.file("a/x.txt"), "mine");
    write_file(folder.file("a/plate.stl"), "plate");
    output.keep();
  }
  EXPECT_EQ(read_text_file(folder.file("a/x.txt"), 9), "mine");
  EXPECT_EQ(read_text_file(folder.file("a/x-2.txt"), 9), "work");
  OutputFolder output(folder.file("a"));
  write_file(output.path() + "/plate.stl", "other");
  EXPECT_ERROR(output.keep(), FileError, "is another file");
}

/// Two of them at the same moment, one for each of two threads.
void signal_two_threads() {
  sigset_t held;
  sigemptyset(&held);
  sigaddset(&held, SIGINT);
  pthread_sigmask(SIG_BLOCK, &held, nullptr);
  std::atomic<int> waiting{2};
  const auto take = [&] {
    pthread_kill(pthread_self(), SIGINT);
    for (--waiting; waiting > 0;) continue;
    pthread_sigmask(SIG_UNBLOCK, &held, nullptr);
  };
  std::thread other(take);
  take();
  other.join();
}

TEST(Signals, ASecondOneEndsTheProgramHoweverSoonItComes) {
  for (int i = 0; i < 100; ++i)
    EXPECT_EXIT((catch_signals(), signal_two_threads(), _exit(0)), testing::KilledBySignal(SIGINT), "");
}

TEST(Signals, WhatMustBeFinishedIs) {
  const auto finish_and_go_on = [] {
    catch_signals();
    {
      const FinishDespiteSignals contact;
      signal_two_threads();
      std::raise(SIGINT);
    }
    std::raise(SIGINT);
    if (interrupting_signal() != SIGINT) _exit(0);
    std::raise(SIGINT);
  };
  EXPECT_EXIT((finish_and_go_on(), _exit(0)), testing::KilledBySignal(SIGINT), "");
}

}  // namespace supertac::common_test
