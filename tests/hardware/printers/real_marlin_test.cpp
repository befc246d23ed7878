// What real Marlin firmware did and the drivers did not expect.

#include "hardware/printers/palpation.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::real_marlin_test {

TEST(RealMarlin, ReportsOfAnEarlierHostAreSwitchedOff) {
  const RigSettings settings = running_rig({.auto_position_s = 0.013, .auto_temperature_s = 0.017});
  const double begin = SimulatedRig(settings).now();
  PrinterBench bench(settings);
  bench.printer.confirm_origin(rig::kMounted);
  EXPECT_LT(bench.rig.now() - begin, 1) << "connecting waited for a silence that never came";
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  bench.printer.link().idle(0.5);
  EXPECT_NEAR(bench.printer.sample_position()->position.x, bench.head().x, 0.05);
}

TEST(RealMarlin, TheLastPositionBeforeTheOkIsTheAnswer) {
  PrinterBench bench;
  bench.printer.confirm_origin(rig::kMounted);
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  bench.printer.link().idle(0.5);
  bench.firmware().inject("X:120.00 Y:101.17 Z:131.81 E:0.00 Count X:0 Y:0 Z:0\n");
  EXPECT_LT(bench.printer.sample_position()->position.x, 105);
}

TEST(RealMarlin, AReportTakenForAnAnswerEndsNoLegAndSwitchesNothingOff) {
  PrinterBench bench;
  bench.printer.confirm_origin(rig::kMounted);
  PalpationObserver observer;
  int slides = 0, polled = 0;
  observer.leg_started = [&](const Leg& leg) {
    slides += leg.phase == Phase::slide ? 1 : 0;
    if (leg.phase != Phase::slide) return;
    // The answer itself is damaged; a report of the queue's end stands before it.
    const std::string target = "X:99.70 Y:209.17 Z:91.81 E:0.00 Count X:0 Y:0 Z:0\n";
    bench.port.from_printer = {{"X:99.70 Y:101.17 Z:91.81 E", target + "X:99.7Y:101.17 Z:91.81 E"},
                               {"X:99.70 Y:11", target + "X:99.70 Y:1.1"}};
  };
  observer.position = [&](const Leg& leg, const PositionSample& sample) {
    if (leg.phase == Phase::slide && sample.position.y < 209) ++polled;
  };
  const PalpationOutcome outcome = Palpation(bench.printer, {.passes = 1}, observer).run();
  EXPECT_TRUE(outcome.complete);
  EXPECT_TRUE(outcome.realtime_position);
  EXPECT_EQ(slides, 1);
  EXPECT_GT(polled, 900) << "the polling stopped at a report of the target";
  EXPECT_TRUE(bench.port.from_printer.empty());
}

TEST(RealMarlin, TheLineBeforeAHaltIsInTheError) {
  PrinterBench bench(running_rig({.homing_fails = true}));
  EXPECT_ERROR(bench.printer.home(), PrinterHalted,
               "the firmware halted ('echo:Homing Failed', 'Error:Printer halted. kill() called!')");
  PrinterBench hot;
  hot.firmware().overheat(hot.rig.now());
  EXPECT_ERROR(hot.printer.queue_position(), PrinterHalted, "Heater_ID: E0");
}

TEST(RealMarlin, ACommandThatTheFirmwareDoesNotKnowIsSentOnce) {
  PrinterBench bench;
  EXPECT_ERROR(bench.printer.link().command("M999"), PrinterRefused, "echo:Unknown command: \"M0999\"");
  EXPECT_EQ(bench.printer.link().counters().repeats, 0U);
}

TEST(RealMarlin, AdvancedOkAndTemperatureBehindTheOkAreUnderstood) {
  PrinterBench bench(running_rig({.advanced_ok = true}));
  bench.printer.confirm_origin(rig::kMounted);
  for (const char* code : {"G21", "M105", "M155 S0"}) bench.printer.link().command(code);
  EXPECT_EQ(bench.printer.link().counters().repeats, 0U);
}

RigSettings klipper_rig() { return running_rig({.firmware = Firmware::klipper}); }

// It would run it again.
TEST(Klipper, IsSentNoLineAgain) {
  PrinterBench bench(klipper_rig());
  bench.printer.confirm_origin(rig::kMounted);
  std::vector<std::string> moves;
  bench.firmware().on_line([&](std::int64_t number, const std::string& command, double) {
    if (!command.starts_with("G1")) return;
    moves.push_back(command);
    if (moves.size() == 2) bench.firmware().inject("Resend: " + std::to_string(number - 1) + "\n");
  });
  const std::vector<std::string> sent = {"G1 X110", "G1 X112", "G1 X114"};
  for (const std::string& move : sent) bench.printer.link().command(move);
  EXPECT_EQ(moves, sent);
}

TEST(Klipper, WhatItSaysReachesTheUser) {
  PrinterBench bench(klipper_rig());
  EXPECT_ERROR(bench.printer.link().command("G1 X10"), PrinterRefused, "!! Must home axis first");
  EXPECT_ERROR(bench.printer.link().command("M410"), PrinterRefused, "// Unknown command:\"M410\"");
  EXPECT_TRUE(bench.printer.emergency_stop().confirmed);
}

TEST(RealMarlin, AStopWhileItHomesStopsTheHead) {
  for (const bool klipper : {false, true}) {
    PrinterBench bench(klipper ? klipper_rig() : running_rig());
    const double begin = bench.rig.now();
    bench.printer.link().set_watch([&] {
      if (bench.rig.now() > begin + 4) throw OperatorStop("asked to stop");
    });
    EXPECT_THROW(bench.printer.home(), OperatorStop);
    EXPECT_LT(bench.rig.now() - begin, 5.7);
    EXPECT_FALSE(bench.firmware().moving(bench.rig.now()));
  }
}

TEST(VirtualPrinter, SpeaksLikeTheRealOne) {
  RigSettings settings;
  settings.printer.emergency_parser = false;
  SimulatedRig rig(settings);
  const auto port = rig.printer_port();
  const auto say = [&](const std::string& text, double seconds) {
    if (!text.empty()) port->write(std::as_bytes(std::span(text)), port->now() + 1);
    std::string got;
    for (const double until = port->now() + seconds; port->now() < until;) {
      std::array<std::byte, 4096> buffer{};
      const Received received = port->read(buffer, until);
      got.append(reinterpret_cast<const char*>(buffer.data()), received.count);
    }
    return got;
  };
  const std::string banner = say("", 1);
  EXPECT_EQ(std::count(banner.begin(), banner.end(), '\n'), 28);
  EXPECT_EQ(say("G21\n", 0.1), "ok\n");
  EXPECT_EQ(say("G92 X5\n", 0.1), "ok\n") << "no position line";
  EXPECT_NE(say("M114\n", 0.1).find("X:5.00 Y:0.00 Z:0.00 E:0.00 Count X:0 "), std::string::npos);
  EXPECT_EQ(say("M105\n", 0.1), "ok T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0\n");
  EXPECT_EQ(say("M0\n", 0.1), "echo:Unknown command: \"M0\"\nok\n");
  const std::string capabilities = say("M115\n", 0.1);
  EXPECT_NEAR(static_cast<double>(std::count(capabilities.begin(), capabilities.end(), '\n')), 30, 4);
  (void)say("M154 S1\n", 0.1);
  EXPECT_NE(say("", 3).find("X:5.00"), std::string::npos);
  (void)say("M154 S0\n", 0.1);
  EXPECT_EQ(say("G1 X50 F600\nG1 X90\nM410\n", 0.9), "") << "M410 holds the firmware for a second";
  EXPECT_FALSE(rig.world().printer().moving(rig.now())) << "an unnumbered stop acts when it is read";
  (void)say("", 2.5);  // it acts when read, and is queued as well
  EXPECT_EQ(say("M112\n", 0.1), "echo:M112 Shutdown\nError:Printer halted. kill() called!\n");
}

}  // namespace supertac::real_marlin_test
