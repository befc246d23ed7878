#include "hardware/printers/printer.h"

#include "hardware/printers/palpation.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::printer_test {

using rig::kMounted;

TEST(Limits, NameTheAxisAndCheckTheWay) {
  const Point3 here = rig::kMounted;
  EXPECT_ERROR(
      Limits{}.check_path(here, {500, 100, 100}), OutsideLimits,
      "limits: X expected 0.00 to 235.00 mm, found 500.00; nothing was sent, correct the plan or the limits");
  EXPECT_ERROR(Limits{}.check_path({100, -1, 100}, here), OutsideLimits,
               "Y expected 0.00 to 235.00 mm, found -1.00");
  EXPECT_ERROR(Limits{}.check_path(here, {100, 100, NAN}), OutsideLimits,
               "Z expected 0.00 to 250.00 mm, found no number");
  EXPECT_NO_THROW(Limits{}.check_path({99.7, 101.17, 91.81}, {99.7, 209.17, 91.81}));
  // Both ends are allowed, the way between them runs through the plate's side.
  EXPECT_ERROR(Limits{}.check_path({50, 101.17, 96}, {99.7, 101.17, 91.81}), OutsideLimits,
               "the way from X50.00 Y101.17 Z96.00 to X99.70 Y101.17 Z91.81 passes");
}

TEST(Printer, WithoutAnOriginOrOutsideTheLimitsNothingIsSent) {
  PrinterBench bench;
  EXPECT_ERROR(bench.printer.start_move({100, 110, 120}, 10), OriginUnknown,
               "the origin is neither homed nor confirmed; nothing was sent, home or confirm it");
  bench.printer.confirm_origin(kMounted);
  EXPECT_ERROR(bench.printer.start_move({500, 101.17, 131.81}, 10), OutsideLimits, "X expected");
  EXPECT_TRUE(moves_of(bench.firmware()).empty());
  EXPECT_EQ(bench.head(), kMounted);
}

TEST(Printer, ArrivesWhereItWasSent) {
  for (const Firmware firmware : {Firmware::marlin, Firmware::klipper}) {
    PrinterBench bench(running_rig({.firmware = firmware}));
    EXPECT_EQ(bench.printer.link().capabilities().klipper, firmware == Firmware::klipper);
    bench.printer.confirm_origin(kMounted);
    bench.printer.start_move({120, 110, 131.81}, 20);
    bench.printer.finish_move();
    EXPECT_LT(distance(bench.head(), {120, 110, 131.81}), 1e-6);
    EXPECT_EQ(bench.printer.link().repeats(), 0U);
    EXPECT_TRUE(bench.printer.quick_stop().confirmed);
  }
}

// Klipper checks no line. The head starts 0.25 s behind its ok.
TEST(Printer, ADamagedLineOfKlippersIsStoppedBeforeItMoves) {
  for (const auto& [sent, came] : {std::pair("Y110.000 Z", "Y11.000 Z"), {"Z131.810 F", "Z13\n1.810 F"}}) {
    ReadyBench bench(running_rig({.firmware = Firmware::klipper}));
    bench.port.to_printer = {{sent, came}};
    EXPECT_ERROR(bench.printer.start_move({120, 110, 131.81}, 20), PositionError,
                 "ordered X120.00 Y110.00 Z131.81, but Klipper took X120.00 Y1");
    bench.rig.run_for(5);
    EXPECT_TRUE(bench.firmware().halted());
    EXPECT_EQ(bench.head(), kMounted);
  }
}

TEST(Printer, ALineThatKlipperDidNotRunIsSentAgain) {
  for (const auto& [sent, came] :
       {std::pair("G1 X120", "P1 X120"), {"G1 X120", "G1\nX120"}, {"M400", "M40"}}) {
    ReadyBench bench(running_rig({.firmware = Firmware::klipper}));
    bench.port.to_printer = {{sent, came}};
    if (*sent == 'M') bench.port.from_printer = {{"Unknown command", "Unknown comman"}};
    bench.printer.start_move({120, 110, 131.81}, 20);
    bench.printer.finish_move();
    EXPECT_LT(distance(bench.head(), {120, 110, 131.81}), 1e-6);
  }
}

TEST(Printer, PlainM114IsNotBelieved) {
  ReadyBench bench;
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  EXPECT_NEAR(bench.printer.queue_position().x, 120, 1e-6) << "the end of the queue, at once";
  EXPECT_NEAR(bench.printer.sample_position()->position.x, 99.7, 1e-6) << "the head has not moved yet";
}

TEST(Printer, MarlinsSilentClampIsFound) {
  PrinterBench bench(running_rig({.bed = {100, 235, 250}}));  // smaller than the limits claim
  bench.printer.home();
  bench.printer.start_move({0, 0, 120}, 50);
  bench.printer.start_move({150, 0, 120}, 50);
  EXPECT_ERROR(bench.printer.finish_move(), PositionError,
               "expected the head at X150.00 Y0.00 Z120.00, found X100.00 Y0.00 Z120.00; confirm the origin "
               "and start again");
}

// Also where M410 holds the firmware for a second, in which it answers nothing; and while M400 is waited for.
TEST(Printer, QuickStopActsAheadOfTheQueue) {
  for (const auto& [parser, in_m400] : {std::pair(true, false), {false, false}, {true, true}}) {
    ReadyBench bench(running_rig({.emergency_parser = parser}));
    bench.printer.start_move({99.7, 201.17, 131.81}, 10);
    const double stop_at = bench.rig.now() + 2;
    bench.printer.link().set_watch([&] {
      if (bench.rig.now() > stop_at) throw OperatorStop("asked to stop");
    });
    EXPECT_THROW(in_m400 ? (void)bench.printer.finish_move() : bench.printer.link().idle(3), OperatorStop);
    bench.printer.link().set_watch(nullptr);
    const Printer::Stop stop = bench.printer.quick_stop();
    EXPECT_TRUE(stop.confirmed) << stop.text;
    EXPECT_EQ(stop.text.find("no emergency parser") != std::string::npos, !parser) << stop.text;
    EXPECT_EQ(bench.printer.link().repeats(), 0U);
    EXPECT_LT(bench.rig.now() - stop_at, 3);
    EXPECT_LT(bench.head().y, 125);
    EXPECT_LT(distance(bench.printer.target(), bench.head()), 0.01);
  }
}

TEST(Printer, ADamagedPositionNeverLowersTheFinger) {
  ReadyBench bench;
  bench.port.from_printer = {{"Z:131.81", "Z:11.81"}};  // a lost digit
  bench.printer.home();
  EXPECT_TRUE(bench.port.from_printer.empty());
  EXPECT_EQ(moves_of(bench.firmware())[0], "G1 Z141.810 F300.0");
}

TEST(Printer, EmergencyStopIsConfirmedByTheHalt) {
  ReadyBench bench;
  bench.printer.start_move({99.7, 201.17, 131.81}, 10);
  EXPECT_TRUE(bench.printer.emergency_stop().confirmed);
  EXPECT_TRUE(bench.firmware().halted());
  EXPECT_THROW(bench.printer.start_move({99.7, 101.17, 131.81}, 10), OriginUnknown);
}

// What real firmware did and the drivers did not expect.

TEST(RealMarlin, ReportsOfAnEarlierHostAreSwitchedOff) {
  const RigSettings settings = running_rig({.auto_position_s = 0.013, .auto_temperature_s = 0.017});
  const double begin = SimulatedRig(settings).now();
  ReadyBench bench(settings);
  EXPECT_LT(bench.rig.now() - begin, 1) << "connecting waited for a silence that never came";
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  bench.printer.link().idle(0.5);
  EXPECT_NEAR(bench.printer.sample_position()->position.x, bench.head().x, 0.05);
}

TEST(RealMarlin, TheLastPositionBeforeTheOkIsTheAnswer) {
  ReadyBench bench;
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  bench.printer.link().idle(0.5);
  bench.firmware().inject("X:120.00 Y:101.17 Z:131.81 E:0.00 Count X:0 Y:0 Z:0\n");
  EXPECT_LT(bench.printer.sample_position()->position.x, 105);
}

TEST(RealMarlin, AReportTakenForAnAnswerEndsNoLegAndSwitchesNothingOff) {
  ReadyBench bench;
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
  const PalpationOutcome outcome = run_palpation(bench.printer, {.passes = 1}, observer);
  EXPECT_TRUE(outcome.complete);
  EXPECT_EQ(slides, 1);
  EXPECT_GT(polled, 900) << "the polling stopped at a report of the target";
  EXPECT_TRUE(bench.port.from_printer.empty());
}

TEST(RealMarlin, TheLineBeforeAHaltIsInTheError) {
  PrinterBench bench(running_rig({.homing_fails = true}));
  EXPECT_ERROR(bench.printer.home(), PrinterHalted,
               "the firmware halted ('echo:Homing Failed', 'Error:Printer halted. kill() called!')");
}

RigSettings klipper_rig() { return running_rig({.firmware = Firmware::klipper}); }

// It would run it again.
TEST(Klipper, IsSentNoLineAgain) {
  ReadyBench bench(klipper_rig());
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

TEST(Klipper, WhatItRefusesIsSentOnceAndSaid) {
  PrinterBench marlin, bench(klipper_rig());
  EXPECT_ERROR(marlin.printer.link().command("M999"), PrinterRefused, "echo:Unknown command: \"M0999\"");
  EXPECT_ERROR(bench.printer.link().command("G1 X10"), PrinterRefused, "!! Must home axis first");
  EXPECT_ERROR(bench.printer.link().command("M410"), PrinterRefused, "// Unknown command:\"M410\"");
  for (PrinterBench* printer : {&marlin, &bench}) EXPECT_EQ(printer->printer.link().repeats(), 0U);
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
  EXPECT_TRUE(say("", 1).starts_with("start\nMarlin 2.1.2\n\necho: "));
  EXPECT_EQ(say("G21\n", 0.1), "ok\n");
  EXPECT_EQ(say("G92 X5\n", 0.1), "ok\n") << "no position line";
  EXPECT_NE(say("M114\n", 0.1).find("X:5.00 Y:0.00 Z:0.00 E:0.00 Count X:0 "), std::string::npos);
  EXPECT_EQ(say("M105\n", 0.1), "ok T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0\n");
  EXPECT_EQ(say("M0\n", 0.1), "echo:Unknown command: \"M0\"\nok\n");
  (void)say("M154 S1\n", 0.1);
  EXPECT_NE(say("", 3).find("X:5.00"), std::string::npos);
  (void)say("M154 S0\n", 0.1);
  EXPECT_EQ(say("G1 X50 F600\nG1 X90\nM410\n", 0.9), "") << "M410 holds the firmware for a second";
  EXPECT_FALSE(rig.world().printer().moving(rig.now())) << "an unnumbered stop acts when it is read";
  (void)say("", 2.5);  // it acts when read, and is queued as well
  EXPECT_EQ(say("M112\n", 0.1), "echo:M112 Shutdown\nError:Printer halted. kill() called!\n");
}

}  // namespace supertac::printer_test
