#include "hardware/printers/printer.h"

#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::printer_test {

using rig::kMounted;

TEST(Limits, NameTheAxisAndCheckTheWay) {
  EXPECT_ERROR(
      Limits{}.check_target({500, 100, 100}), OutsideLimits,
      "limits: X expected 0.00 to 235.00 mm, found 500.00; nothing was sent, correct the plan or the limits");
  EXPECT_ERROR(Limits{}.check_target({100, -1, 100}), OutsideLimits,
               "Y expected 0.00 to 235.00 mm, found -1.00");
  EXPECT_ERROR(Limits{}.check_target({100, 100, NAN}), OutsideLimits,
               "Z expected 0.00 to 250.00 mm, found no number");
  EXPECT_NO_THROW(Limits{}.check_path({99.7, 101.17, 91.81}, {99.7, 209.17, 91.81}));
  // Both ends are allowed, the way between them runs through the plate's side.
  EXPECT_ERROR(Limits{}.check_path({50, 101.17, 96}, {99.7, 101.17, 91.81}), OutsideLimits,
               "the way from X50.00 Y101.17 Z96.00 to X99.70 Y101.17 Z91.81 passes");
}

TEST(Printer, NothingMovesWithoutAnOrigin) {
  PrinterBench bench;
  EXPECT_ERROR(bench.printer.start_move({100, 110, 120}, 10), OriginUnknown,
               "the origin is neither homed nor confirmed; nothing was sent, home or confirm it");
  EXPECT_TRUE(moves_of(bench.firmware()).empty());
}

TEST(Printer, OutsideTheLimitsNothingIsSent) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  EXPECT_ERROR(bench.printer.start_move({500, 101.17, 131.81}, 10), OutsideLimits, "X expected");
  EXPECT_ERROR(bench.printer.start_move(rig::kMounted, INFINITY), std::invalid_argument,
               "expected a speed above 0 mm/s, got inf");
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
    EXPECT_EQ(bench.printer.link().counters().repeats, 0U);
    EXPECT_TRUE(bench.printer.quick_stop().confirmed);
  }
}

// Klipper checks no line. The head starts 0.25 s behind its ok.
TEST(Printer, ADamagedLineOfKlippersIsStoppedBeforeItMoves) {
  for (const auto& [sent, came] : {std::pair("Y110.000 Z", "Y11.000 Z"), {"Z131.810 F", "Z13\n1.810 F"}}) {
    PrinterBench bench(running_rig({.firmware = Firmware::klipper}));
    bench.printer.confirm_origin(kMounted);
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
    PrinterBench bench(running_rig({.firmware = Firmware::klipper}));
    bench.printer.confirm_origin(kMounted);
    bench.port.to_printer = {{sent, came}};
    if (*sent == 'M') bench.port.from_printer = {{"Unknown command", "Unknown comman"}};
    bench.printer.start_move({120, 110, 131.81}, 20);
    bench.printer.finish_move();
    EXPECT_LT(distance(bench.head(), {120, 110, 131.81}), 1e-6);
  }
}

TEST(Printer, PlainM114IsNotBelieved) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  bench.printer.start_move({120, 101.17, 131.81}, 10);
  EXPECT_NEAR(bench.printer.queue_position().x, 120, 1e-6) << "the end of the queue, at once";
  EXPECT_NEAR(bench.printer.sample_position()->position.x, 99.7, 1e-6) << "the head has not moved yet";
}

TEST(Printer, HomesWithTheFingerUp) {
  for (const Firmware firmware : {Firmware::marlin, Firmware::klipper}) {
    PrinterBench bench(running_rig({.firmware = firmware}));
    bench.printer.home();
    const auto& executed = bench.firmware().executed();
    std::size_t lift = 0, home = 0;
    for (std::size_t i = 0; i < executed.size(); ++i) {
      if (executed[i].command.starts_with("G1 Z10")) lift = i;
      if (executed[i].command == "G28") home = i;
    }
    EXPECT_GT(lift, 0U);
    EXPECT_LT(lift, home);
    EXPECT_EQ(bench.printer.origin(), Printer::Origin::homed);
  }
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

// Also where M410 holds the firmware for a second, in which it answers nothing.
TEST(Printer, QuickStopActsAheadOfTheQueue) {
  for (const bool parser : {true, false}) {
    PrinterBench bench(running_rig({.emergency_parser = parser}));
    bench.printer.confirm_origin(kMounted);
    bench.printer.start_move({99.7, 201.17, 131.81}, 10);
    bench.printer.link().idle(2);
    const double before = bench.rig.now();
    const Printer::Stop stop = bench.printer.quick_stop();
    EXPECT_TRUE(stop.confirmed) << stop.text;
    EXPECT_EQ(stop.text.find("behind the queue"), std::string::npos) << stop.text;
    EXPECT_EQ(bench.printer.link().counters().timeouts, 0U);
    EXPECT_LT(bench.rig.now() - before, 3);
    EXPECT_LT(bench.head().y, 125);
    EXPECT_LT(distance(bench.printer.target(), bench.head()), 0.01);
  }
}

TEST(Printer, StopsDuringM400) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  bench.printer.start_move({99.7, 201.17, 131.81}, 10);
  const double stop_at = bench.rig.now() + 3;
  bench.printer.link().set_watch([&] {
    if (bench.rig.now() > stop_at) throw OperatorStop("asked to stop");
  });
  EXPECT_THROW(bench.printer.finish_move(), OperatorStop);
  bench.printer.link().set_watch(nullptr);
  EXPECT_TRUE(bench.printer.quick_stop().confirmed);
  EXPECT_LT(bench.head().y, 140);
}

TEST(Printer, SaysSoWithoutEmergencyParser) {
  PrinterBench bench(running_rig({.emergency_parser = false}));
  EXPECT_NE(bench.printer.quick_stop().text.find("no emergency parser"), std::string::npos);
}

TEST(Printer, ADamagedPositionNeverLowersTheFinger) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  bench.port.from_printer = {{"Z:131.81", "Z:11.81"}};  // a lost digit
  bench.printer.home();
  EXPECT_TRUE(bench.port.from_printer.empty());
  EXPECT_EQ(moves_of(bench.firmware())[0], "G1 Z141.810 F300.0");
}

TEST(Printer, EmergencyStopIsConfirmedByTheHalt) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  bench.printer.start_move({99.7, 201.17, 131.81}, 10);
  EXPECT_TRUE(bench.printer.emergency_stop().confirmed);
  EXPECT_TRUE(bench.firmware().halted());
  EXPECT_THROW(bench.printer.start_move({99.7, 101.17, 131.81}, 10), OriginUnknown);
}

}  // namespace supertac::printer_test
