#include "hardware/printers/marlin_link.h"

#include "tests/hardware/fake_port.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::marlin_link_test {

constexpr std::int64_t kConnecting = 1;  // lines that connecting sends: M115

/// A connected link over a simulated printer.
struct Bench {
  explicit Bench(const RigSettings& settings = running_rig())
      : rig(settings), port(rig.printer_port()), link(port) {
    link.connect();
  }
  VirtualPrinter& printer() { return rig.world().printer(); }
  /// Runs `plant` once, just before line `number` after connecting runs.
  void before_line(std::int64_t number, std::function<void(VirtualPrinter&, double)> plant) {
    auto done = std::make_shared<bool>(false);
    printer().on_line([=, this](std::int64_t n, const std::string&, double t) {
      if (n != kConnecting + number || *done) return;
      *done = true;
      plant(printer(), t);
    });
  }
  /// Moves to X1, X2 and so on, each of which has to run once.
  void go(int count) {
    std::vector<std::string> expected;
    for (int i = 1; i <= count; ++i) link.command(expected.emplace_back("G1 X" + std::to_string(i)));
    EXPECT_EQ(moves_of(printer()), expected);
  }
  SimulatedRig rig;
  Tampering port;
  MarlinLink link;
};

TEST(MarlinLink, ConnectsToAFreshBoardThroughBootGarbageAndHeartbeats) {
  RigSettings settings;
  settings.printer.boot_s = 3;
  settings.printer.boot_garbage = "\x80\xff\x01zz\nok\x0e\xfe";
  settings.printer.heartbeat = true;
  Bench bench(settings);
  EXPECT_TRUE(bench.link.capabilities().emergency_parser);
  EXPECT_NE(bench.link.capabilities().firmware.find("Marlin"), std::string::npos);
  bench.rig.run_for(5);  // `wait` every second
  EXPECT_NO_THROW(bench.link.command("M114"));
}

TEST(MarlinLink, NobodyThereIsATypedErrorInTime) {
  RigSettings settings;
  settings.printer.boot_s = 1e6;
  SimulatedRig rig(settings);
  const auto port = rig.printer_port();
  MarlinLink link(*port);
  const double start = port->now();
  EXPECT_ERROR(
      link.connect(), PrinterSilent,
      "expected a Marlin firmware, found no answer to M110 within 20 s; check that the printer is on");
  EXPECT_LT(port->now() - start, 25);
}

// Damaged, never arrived, without its N (acknowledged, but not run), glued to the next one.
TEST(MarlinLink, DamagedLineIsSentAgainAndRunsOnce) {
  for (const auto& [sent, came] : {std::pair("X3", "X8"), {"N4 G1 X3*", "\n;"}, {"N4 ", "4 "}, {"\n", ""}}) {
    Bench bench;
    bench.port.to_printer = {{sent, came}};
    bench.go(5);
    EXPECT_TRUE(bench.port.to_printer.empty()) << sent;
  }
  Bench last;  // no later line would bring it to light
  last.port.to_printer = {{"N4 ", "4 "}};
  last.go(3);
  EXPECT_TRUE(last.port.to_printer.empty());
}

TEST(MarlinLink, ResendOfALineNeverSentIsIgnored) {
  Bench bench;
  bench.before_line(2, [](VirtualPrinter& printer, double) { printer.inject("Resend: 999\nok\n"); });
  bench.go(5);
}

TEST(MarlinLink, SameLineTooOftenIsAResendLoop) {
  Bench bench;
  bench.port.to_printer.assign(50, {"G1 X1", "G1 X7"});
  EXPECT_ERROR(bench.link.command("G1 X1"), ResendLoop,
               "line 2 repeated 8 times without success (the firmware reports damaged lines): resend loop; "
               "check the cable");
  EXPECT_TRUE(moves_of(bench.printer()).empty());
}

TEST(MarlinLink, LostOkIsAskedForAndNothingRunsTwice) {
  for (const Firmware firmware : {Firmware::marlin, Firmware::marlin_before_2_1_2}) {
    for (const char* damage : {"", "ok\x0e", "o\n", "k\n", "\xefk\n"}) {
      SCOPED_TRACE("ok became \"" + std::string(damage) + '"');
      Bench bench(running_rig({.firmware = firmware}));
      bench.port.from_printer = {{"ok\n", damage}};
      const double begin = bench.rig.now();
      bench.go(5);
      EXPECT_EQ(bench.link.repeats(), 1U);
      EXPECT_LT(bench.rig.now() - begin, 4);
    }
  }
}

// The ordinary deadline is 2 s: echo:busy renews it; where none is said the command has its own.
TEST(MarlinLink, LongCommandsAreWaitedFor) {
  for (const bool keepalive : {true, false}) {
    Bench bench(running_rig({.keepalive = keepalive}));
    const double start = bench.port.now();
    EXPECT_NO_THROW(bench.link.command("G4 S30", keepalive ? 0 : 40));
    EXPECT_GE(bench.port.now() - start, 30);
    EXPECT_LE(bench.link.repeats(), keepalive ? 1U : 0U);
  }
}

TEST(MarlinLink, PausedForUserIsAnError) {
  Bench bench;
  bench.before_line(1,
                    [](VirtualPrinter& printer, double) { printer.inject("echo:busy: paused for user\n"); });
  EXPECT_ERROR(bench.link.command("G1 X1"), PrinterPaused,
               "waits for its user; look at the printer's display");
}

TEST(MarlinLink, StartInMidRunIsAReset) {
  Bench bench;
  bench.before_line(2, [](VirtualPrinter& printer, double t) { printer.reset(t); });
  bench.link.command("G1 X1");
  EXPECT_ERROR(bench.link.command("G1 X2"), PrinterReset,
               "the firmware restarted in use; its position is unknown, confirm the origin and start again");
}

TEST(MarlinLink, AResetWhoseBannerIsLostIsSeenInTheLineNumber) {
  Bench bench;
  bench.go(10);
  bench.printer().reset(bench.rig.now());
  bench.port.from_printer = {{"start\nMarlin 2", "sxart\nMar1in 2"}};
  EXPECT_ERROR(bench.link.command("G1 X11"), PrinterReset, "so it restarted; its position is unknown");
  EXPECT_EQ(moves_of(bench.printer()).size(), 10U) << "a line ran on the restarted firmware";
}

TEST(MarlinLink, AfterAHaltNothingMoreIsSent) {
  for (const char* text :
       {"Error:Printer halted. kill() called!\n", "Error:Heating failed, system stopped!\n",
        "Error:MAXTEMP triggered, system stopped! Heater_ID: 0\n"}) {
    Bench bench;
    bench.before_line(1, [text](VirtualPrinter& printer, double) { printer.inject(text); });
    EXPECT_ERROR(bench.link.command("G1 X1"), PrinterHalted, "the firmware halted ('Error:");
    const std::int64_t last = bench.printer().last_line();
    EXPECT_ERROR(bench.link.command("G1 X2"), PrinterHalted, "halted earlier; reset it and start again");
    EXPECT_EQ(bench.printer().last_line(), last);
  }
}

TEST(MarlinLink, ARefusedCommandIsNotSentForEver) {
  Bench bench;
  bench.before_line(1, [](VirtualPrinter& printer, double) { printer.inject("Error:Probing failed\n"); });
  EXPECT_ERROR(bench.link.command("G1 X1"), PrinterRefused, ": Error:Probing failed");
  EXPECT_NO_THROW(bench.link.command("M114"));
}

std::string connects(const std::string& line) { return line.starts_with("N0 ") ? "ok\n" : ""; }

TEST(MarlinLink, APrinterThatAsksForLineOneForEverIsAResendLoop) {
  ScriptedPrinter port([](const std::string& line) -> std::string {
    if (line.starts_with("N0 ") || line.starts_with("N1 ")) return "ok\n";
    return "Error:Line Number is not Last Line Number+1, Last Line: 0\nResend: 1\nok\n";
  });
  MarlinLink link(port);
  EXPECT_ERROR(link.connect(), ResendLoop, "resend loop; check the cable");
  EXPECT_LT(port.now(), 60);
  EXPECT_LT(port.writes(), 200);
}

TEST(MarlinLink, AnswersWithoutProgressEnd) {
  for (const auto& [answer, says] :
       {std::pair("echo:busy: processing", "within 60 s, found other answers ('echo:busy: processing' last)"),
        {"T:25.0", "line 1 repeated 8 times without success (no answer)"}}) {
    ScriptedPrinter talker(connects, std::string(answer) + "\n");
    MarlinLink link(talker);
    EXPECT_ERROR(link.connect(), PrinterSilent, says);
    EXPECT_LT(talker.now(), 90);
    using Wait = void (*)(MarlinLink&);
    for (const Wait wait : {Wait([](MarlinLink& l) { l.idle(1); }), Wait([](MarlinLink& l) { l.settle(); }),
                            Wait([](MarlinLink& l) { l.abandon(1); })}) {
      const double begin = talker.now();
      wait(link);
      EXPECT_LT(talker.now(), begin + 3.1);
    }
  }
  for (const auto& [answer, always, says] : {std::tuple("", "hello \n", "it said 'hello'"),
                                             {"", "x", "bytes that are no answer"},  // and no line
                                             {"error:20\n", "", "it said 'error:20'"},
                                             {"", "812,-70,4.5e2, 99\r\n", "it said '812,-70,4.5e2, 99'"}}) {
    ScriptedPrinter stranger([&, &answer = answer](const std::string&) { return answer; }, always);
    MarlinLink link(stranger);
    EXPECT_ERROR(link.connect(), WrongDevice, says);
    EXPECT_LT(stranger.now(), 25);
  }
}

TEST(MarlinLink, AnEndThatIsNeverAcknowledgedIsNotAwaitedForEver) {
  std::int64_t last = 0;
  ScriptedPrinter port([&](const std::string& line) -> std::string {
    const std::int64_t number = std::stoll(line.substr(1));
    if (number < 2) return number == 0 ? "ok\n" : "FIRMWARE_NAME:Marlin\nCap:EMERGENCY_PARSER:1\nok\n";
    if (number < last + 500) return last = number, "";
    return "Error:Line Number is not Last Line Number+1, Last Line: " + std::to_string(last) + "\nok\n";
  });
  MarlinLink link(port);
  link.connect();
  EXPECT_ERROR(link.command("G28", 10), PrinterSilent,
               "expected an ok to M400 behind 'G28', found none of 6");
  EXPECT_LT(port.now(), 100);
}

TEST(MarlinLink, ARunHasABoundOfItsOwn) {
  ScriptedPrinter port(connects, "echo:busy: processing\n");
  MarlinLink link(port);
  link.give_up_at(5);
  EXPECT_ERROR(link.connect(), PrinterSilent, "did not come to an end in time");
  EXPECT_LT(port.now(), 5.1);
}

TEST(MarlinLink, EveryLineRunsOnceInOrderAtFiftyTimesTheUsualFaults) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    RigSettings settings = running_rig(
        {.firmware = seed % 2 == 0 ? Firmware::marlin : Firmware::marlin_before_2_1_2},
        {.byte_rate = 0.002, .lost_ok_rate = 0.01, .resend_storm_rate = 0.01, .stall_rate = 0.01});
    settings.seed = seed;
    Bench bench(settings);
    std::vector<std::string> expected;
    for (int i = 1; i <= 200; ++i) {
      expected.push_back("G1 X" + std::to_string(i % 7));
      bench.link.command(expected.back());
    }
    bench.link.command("M400", 60);
    const std::vector<std::string> ran = moves_of(bench.printer());
    const auto [first, second] = std::mismatch(ran.begin(), ran.end(), expected.begin(), expected.end());
    EXPECT_TRUE(ran == expected) << "seed " << seed << ", " << ran.size() << " moves, first difference at "
                                 << first - ran.begin() << ": " << (first == ran.end() ? "missing" : *first);
  }
}

}  // namespace supertac::marlin_link_test
