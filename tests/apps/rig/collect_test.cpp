// supertac-collect as a process on a virtual rig: how it ends, what it says, where the finger is left.
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "hardware/collection/collection.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/apps/rig/collect_run.h"
#include "tests/apps/web/http_client.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/hardware/numbered_board.h"
#include "tests/support/test.h"

namespace supertac::collect_test {

TEST(CollectProgram, MakesRecordingsAndLeavesTheHeadAtItsOrigin) {
  CollectRun run;
  const ProcessResult result = run.collect();
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(run.files(), "3_Bumps_t1_p1_v10.safetensors 3_Bumps_t1_v10.journal provenance.jsonl");
  succeed_in(run.out(), "supertac-info 3_Bumps_t1_p1_v10.safetensors");
  EXPECT_LT(distance(run.head(), {99.7, 101.17, 131.81}), 0.01);
  EXPECT_FALSE(run.origin_unknown());
}

TEST(CollectProgram, SignalsInContactLiftTheFingerAndKeepWhatWasRecorded) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    CollectRun run;
    const ProcessResult result = run.collect_until_contact([signal](RunningProcess& process) {
      process.send(signal);
      process.send(signal);  // a closed terminal says so twice; the finger comes first
    });
    expect_failure(result, 128 + signal, "");
    EXPECT_GE(run.head().z, kLiftedZ - 0.01) << "signal " << signal;
    EXPECT_EQ(run.files(), "3_Bumps_t1_p1_v10.safetensors 3_Bumps_t1_v10.journal provenance.jsonl");
    EXPECT_TRUE(run.origin_unknown());
  }
}

// Stopped as by Ctrl-Z, or on a machine that swaps: every pass is right by frame number, or says that it is
// not. SUPERTAC_MUTATIONS says how often.
TEST(CollectProgram, StoppedForAWhileItIsRightOrSaysSo) {
  for (int seed = 1; seed <= mutations(2); ++seed) {
    const RandomStream draw(static_cast<std::uint64_t>(seed), 3);
    RigSettings settings = CollectRun::running();
    NumberedBoard numbers(settings);
    CollectRun run(4, settings);
    run.rig().with_world([&](RigWorld& world) { numbers.watch(world.board()); });
    RunningProcess process = run.start();
    ASSERT_TRUE(run.wait_for_contact(9 * draw.uniform(0), process)) << process.wait().error;
    process.send(SIGSTOP);
    usleep(static_cast<useconds_t>(1e6 * (0.05 + 1.5 * draw.uniform(1))));
    process.send(SIGCONT);
    const ProcessResult result = process.wait();
    if (result.code != 0) expect_failure(result, 1, "");
    for (const CollectedPass& pass : collection_of(read_journal(run.journal())).passes) {
      if (!pass.complete || !pass.doubt.empty()) continue;
      double worst = 0;
      run.rig().with_world([&](RigWorld&) {  // which goes on
        for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
          const double* p = &pass.position[3 * i];
          for (const std::uint64_t n : numbers.numbers_in(pass.signals, i))
            worst = std::max(worst, distance(numbers.head(n), {p[0], p[1], p[2]}));
        }
      });
      EXPECT_LE(worst, kTrustedMm) << "seed " << seed;
    }
  }
}

// A printer that says nothing is waited for 20 s; nothing moves, so that a signal ends the program at once.
TEST(CollectProgram, ASignalWhileItConnectsEndsItWithoutATrace) {
  CollectRun run(1);
  const TemporaryFolder folder;
  const PseudoTerminal silent(folder / "silent");
  for (const int signal : {SIGINT, SIGTERM}) {
    RunningProcess process = run.start("--quiet --printer " + folder / "silent");
    wait_for_file(run.journal());
    process.send(signal);
    const ProcessResult result = process.wait();
    expect_failure(result, 128 + signal, "");
    EXPECT_EQ(run.files(), "");
  }
}

TEST(CollectProgram, AfterAKillTheJournalIsRecoveredAndTheOriginMustBeConfirmed) {
  CollectRun run;
  run.collect_until_contact([](RunningProcess& process) { process.send(SIGKILL); });
  run.wait_for_rest();

  // Whatever the folder: the mark is the printer's, and holds up no other one.
  const std::string other = run.disk() + "/other";
  {
    const CollectRun another;
    setenv("XDG_STATE_HOME", (run.disk() + "/state").c_str(), 1);
    EXPECT_FALSE(contains(another.collect("--speed 50").error, "--confirm-origin"));
  }
  const Point3 left = run.head();
  for (const std::string& out : {run.out(), other}) {
    expect_failure(run.collect("--out " + out), 1, "--confirm-origin");
  }
  EXPECT_EQ(run.head(), left);
  const ProcessResult recovered =
      succeed_in(run.disk(), "supertac-import --out again --journal " + run.journal());
  EXPECT_TRUE(contains(recovered.out, "cut off"));

  const ProcessResult confirmed = run.collect("--confirm-origin --speed 50 --out " + other);
  EXPECT_EQ(confirmed.code, 0) << confirmed.error;
  EXPECT_FALSE(run.origin_unknown());
}

TEST(CollectProgram, WhatIsThereAlreadyIsFoundBeforeAnythingMoves) {
  CollectRun run;
  std::filesystem::create_directories(run.out());
  std::filesystem::create_symlink("nowhere", run.out() + "/3_Bumps_t1_p1_v10.safetensors");
  std::ofstream(run.out() + "/3_Bumps_t2_v10.journal") << "of another run\n";
  const Point3 before = run.head();
  const auto refuse = [&](const std::string& more, const std::string& says) {
    expect_failure(run.collect(more), 1, says);
  };
  refuse("", "3_Bumps_t1_p1_v10.safetensors: exists already; collect with another --trial, or pass --force");
  refuse("--trial 2 --force", "3_Bumps_t2_v10.journal: exists already; collect with another --trial, for no");
  EXPECT_EQ(run.head(), before);
}

TEST(CollectProgram, ARunWithoutAFrameLeavesNoJournalInTheNextOnesWay) {
  CollectRun run;
  RunningProcess process = run.start();
  while (run.head().z > 130 && !process.ended()) usleep(1000);
  process.send(SIGINT);
  const ProcessResult result = process.wait();
  EXPECT_EQ(result.code, 130) << result.error;
  EXPECT_EQ(run.files(), "");
  run.wait_for_rest();
}

// Where the finger is, what ended the run and what became of its frames, although no recording can be made.
TEST(CollectProgram, ARunWhoseRecordingsCannotBeKeptSaysWhatItLeft) {
  CollectRun run;
  const auto block_provenance = [&run](RunningProcess& process) {
    std::filesystem::create_directory(run.out() + "/provenance.jsonl");
    process.send(SIGINT);
  };
  const ProcessResult result = run.collect_until_contact(block_provenance, "");
  EXPECT_EQ(result.code, 130) << result.error;
  const std::size_t finger = result.error.find("incomplete after 0 passes; the finger was lifted\n");
  const std::size_t cause =
      result.error.find("; stopped by the operator; " + run.out() + "/provenance.jsonl");
  EXPECT_LT(finger, cause) << result.error;
  EXPECT_NE(cause, std::string::npos) << result.error;
  EXPECT_TRUE(contains(result.error, "the journal " + run.journal() + " is kept"));
  succeed_in(run.disk(), "supertac-import --out again --journal " + run.journal());
}

TEST(CollectProgram, AFullDiskInContactLiftsTheFinger) {
  CollectRun run;
  const ProcessResult result = run.collect("", {.max_file_bytes = 2'500'000});
  expect_failure(result, 1, "journal");
  EXPECT_GE(run.head().z, kLiftedZ - 0.01);
  EXPECT_FALSE(contains(run.files(), ".tmp"));
}

TEST(CollectProgram, TheQuestionMayBeAnsweredWithY) {
  CollectRun run;
  std::string words = SUPERTAC_BIN "/" + run.line("--quiet --speed 50");
  words.erase(words.find("--yes "), 6);
  const auto answer = [&](const std::string& text) {
    return std::system(
        ("printf '" + text + "\\n' | script -qec '" + words + "' /dev/null >/dev/null").c_str());
  };
  EXPECT_NE(answer("perhaps"), 0);
  EXPECT_EQ(run.files(), "");
  EXPECT_EQ(answer("y"), 0);
  EXPECT_NE(run.files(), "");
}

// Nothing moves, nothing is left behind, and one line says what is wrong and what to do.
TEST(CollectProgram, APortThatCannotBeUsedIsOneClearLine) {
  CollectRun run;
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "text";
  for (const auto& [arguments, says] : std::vector<std::pair<std::string, std::vector<std::string>>>{
           {"--printer " + folder / "none", {folder / "none", "no such port", "supertac-check machine"}},
           {"--printer " + folder / "file", {"expected a serial port", "supertac-check machine"}},
           {"--board /dev/null", {"expected a serial port", "supertac-check machine"}},
           {"--board " + run.printer() + " --printer " + run.board(), {"exchange the two ports"}},
           {"--board " + run.printer(), {"already open"}}}) {
    const ProcessResult result = run.collect(arguments);
    for (const std::string& part : says) expect_failure(result, 1, part);
    EXPECT_EQ(run.files(), "") << says[0];
  }
  EXPECT_LT(distance(run.head(), {99.7, 101.17, 131.81}), 1e-6);
  EXPECT_EQ(run.collect("--speed 50").code, 0) << "the next start, with the right ports, is not held up";
}

// It shows the run and can end it, and nothing else.
TEST(CollectPage, ShowsTheRunAndItsButtonEndsItAsCtrlCDoes) {
  CollectRun run;
  const int port = free_port();
  const std::string number = std::to_string(port), host = "Host: 127.0.0.1:" + number + "\r\n";
  RunningProcess program = run.start("--quiet --web " + number);
  const std::unique_ptr<HttpClient> client = connect_when_up(port);
  ASSERT_TRUE(client);
  client->send("GET /events HTTP/1.1\r\n" + host + "\r\n");
  const auto hello = event_after(client->receive("\n\n"), "event: hello\ndata: ");
  EXPECT_EQ(hello["plate"], "3_Bumps");
  EXPECT_EQ(hello["passes"].get<std::vector<double>>(), std::vector<double>{0.5});
  ASSERT_TRUE(run.wait_for_contact(1, program));
  const auto act = [&](const std::string& action) {
    return status_of(port, "POST /" + action + " HTTP/1.1\r\nContent-Length: 0\r\n" + host +
                               "Origin: http://127.0.0.1:" + number +
                               "\r\nX-Token: " + hello["token"].get<std::string>() + "\r\n\r\n");
  };
  const std::string seen = client->receive("\"phase\":\"slide\"");
  EXPECT_TRUE(contains(seen, "\"lifted\":false"));
  for (const char* action : {"start", "move", "home", "record"}) EXPECT_EQ(act(action), 404) << action;
  EXPECT_EQ(act("stop"), 200);
  act("stop");  // an impatient hand
  const ProcessResult result = program.wait();
  EXPECT_EQ(result.code, 130) << result.error;
  const auto end = event_after(client->receive("what never comes"), "event: end\ndata: ");
  EXPECT_TRUE(end["outcome"].get<std::string>().starts_with("incomplete after 0 passes")) << end;
  run.wait_for_rest();
  EXPECT_GT(run.head().z, kLiftedZ - 0.1);
}

}  // namespace supertac::collect_test
