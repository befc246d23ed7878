// Printers as another job, a display or a start of their own left them.
#include "hardware/printers/printer.h"

#include "tests/hardware/fault_run.h"
#include "tests/support/test.h"

namespace supertac::machine_state_test {

constexpr Firmware kFirmwares[] = {Firmware::marlin, Firmware::marlin_before_2_1_2, Firmware::klipper};
constexpr Point3 kLowDown{99.7, 101.17, 99.81};

TEST(MachineState, EachLeftoverAloneIsSetAndPutBack) {
  const std::vector<LeftOver> marlin = {
      {.inches = true},     {.relative = true}, {.speed_percent = 150},     {.speed_percent = 50},
      {.flow_percent = 80}, {.mesh_mm = 0.46},  {.home_offset = {1, 2, -3}}};
  const std::vector<LeftOver> klipper = {{.relative = true},
                                         {.speed_percent = 150},
                                         {.flow_percent = 80},
                                         {.mesh_mm = 0.46},
                                         {.offset = {0, 0, -0.35}}};
  for (const Firmware firmware : kFirmwares) {
    for (const LeftOver& left : firmware == Firmware::klipper ? klipper : marlin) {
      const FaultVerdict verdict = run_faulty_collection(
          running_rig({.firmware = firmware, .left_over = left}), {.passes = 1, .slide = 20}, kLowDown);
      EXPECT_TRUE(verdict.complete) << verdict.error;
      EXPECT_EQ(verdict.broken, "") << static_cast<int>(firmware) << ", " << left.inches << left.relative
                                    << left.speed_percent << " " << left.mesh_mm << " " << left.offset.z;
      if (firmware != Firmware::klipper) {
        EXPECT_EQ(verdict.doubt, "");
        EXPECT_LT(verdict.worst_mm, 0.05);
      }
    }
  }
}

TEST(MachineState, ADamagedAnswerIsNeitherRefusedNorPutBack) {
  for (const auto& [said, damaged] :
       {std::pair("FR:100%", "FR:150%"), {"Bed Leveling OFF", "Bed Leveling ON"}, {"  G21 ;", "  G20 ;"}}) {
    PrinterBench bench(running_rig(), {{said, damaged}});
    bench.printer.put_back();
    EXPECT_TRUE(bench.port.from_printer.empty());
    EXPECT_EQ(bench.firmware().left_over(), LeftOver{}) << said;
  }
  PrinterBench bench(running_rig({.left_over = {.inches = true}}), {{"  G20 ;", "  G21 ;"}});
  bench.printer.put_back();
  EXPECT_TRUE(bench.firmware().left_over().inches);
}

TEST(MachineState, WhatIsNotPutBackIsSaid) {
  PrinterBench marlin(running_rig({.left_over = {.speed_percent = 150}}));
  EXPECT_EQ(marlin.printer.put_back(),
            "absolute positions (G90), reports of position (M154 S0), reports of temperature (M155 S0)");
  EXPECT_EQ(marlin.firmware().left_over().speed_percent, 150);
  PrinterBench paused(running_rig({.left_over = {.speed_percent = 150, .flow_percent = 80}}),
                      {{"X:", "X:"}, {"ok\n", "//action:pause\n"}, {"ok\n", "o\n"}});
  (void)paused.printer.queue_position();
  (void)paused.printer.put_back();
  EXPECT_EQ(paused.firmware().left_over(), (LeftOver{.speed_percent = 150, .flow_percent = 80}));
  PrinterBench klipper(running_rig({.firmware = Firmware::klipper, .left_over = {.mesh_mm = 0.46}}));
  EXPECT_EQ(klipper.printer.put_back(), "");
  PrinterBench gone(running_rig({.left_over = {.mesh_mm = 0.46}}));
  gone.rig.unplug_printer();
  EXPECT_EQ(gone.printer.put_back(),
            "absolute positions (G90), reports of position (M154 S0), reports of temperature (M155 S0), mesh "
            "compensation (M420 S0)");
}

TEST(MachineState, WhatStaysAnotherIsRefusedByName) {
  const std::vector<Tampering::Change> damaged(40, {"Bed Leveling OFF", "Bed Leveling ON"});
  EXPECT_ERROR(
      PrinterBench(running_rig(), damaged), PrinterRefused,
      "expected its mesh compensation at 'Bed Leveling OFF', found 'Bed Leveling ON' after M420 S0; set it "
      "by hand");
}

TEST(MachineState, AFirmwareIsKnownByAnUndamagedNameOrRefused) {
  const Tampering::Change damaged{"FIRMWARE_NAME:Marlin", "FIRMWARE_NAME: RepRapFi2mware SOURCE:"},
      other{"FIRMWARE_NAME:Marlin", "FIRMWARE_NAME: RepRapFirmware for Duet 2"},
      klipper{":Klipper", ":Klippdr"};
  EXPECT_ERROR(PrinterBench(running_rig(), {damaged, damaged, other, other, other, other}), WrongDevice,
               "expected Marlin or Klipper, found 'RepRapFirmware for Duet 2");
  const RigSettings rig = running_rig({.firmware = Firmware::klipper});
  EXPECT_TRUE(PrinterBench(rig, {klipper, klipper}).printer.link().capabilities().klipper);
  EXPECT_ERROR(PrinterBench(rig, std::vector(6, klipper)), WrongDevice,
               "found 'Klippdr' as its name (M115), which is neither");
}

TEST(MachineState, WhatAKlipperRefusesIsSaidAgain) {
  const LeftOver left{.relative = true, .speed_percent = 150, .mesh_mm = 0.46, .offset = {0, 0, -0.35}};
  PrinterBench bench(running_rig({.firmware = Firmware::klipper, .left_over = left}));
  bench.port.to_printer = {{"LOAD=supertac", "LOAD=supertab"}, {"NAME=supertac", "NAME=supertab"}};
  EXPECT_EQ(bench.printer.put_back(), "");
  EXPECT_TRUE(bench.port.to_printer.empty());
  EXPECT_EQ(bench.firmware().left_over(), left);
  bench.firmware().reset(bench.rig.now());
  EXPECT_ERROR(bench.printer.link().idle(1), PrinterReset, "it said '// Klipper state: Disconnect'");
}

TEST(MachineState, AHomeOffsetIsRefusedByNameWhereItShiftsTheBed) {
  PrinterBench bench(running_rig({.left_over = {.home_offset = {0, 0, -1.25}}}));
  EXPECT_ERROR(bench.printer.home(), PrinterRefused, "home offset (M206)");
  EXPECT_TRUE(moves_of(bench.firmware()).empty());
  bench.printer.confirm_origin(rig::kMounted);
  EXPECT_EQ(bench.printer.origin(), Printer::Origin::confirmed);
}

TEST(MachineState, HomingFirstLiftsTenMillimetresWhateverTheUnit) {
  constexpr Point3 kHead = {20, 30, 15};
  for (const VirtualPrinterSettings& printer : {VirtualPrinterSettings{.head = kHead},
                                                {.firmware = Firmware::klipper, .head = kHead},
                                                {.head = kHead, .left_over = {.inches = true}},
                                                {.head = kHead, .left_over = {.relative = true}}}) {
    PrinterBench bench(running_rig(printer));
    double highest = 0;
    bench.printer.link().set_watch([&] {
      if (bench.head().x > 19.9) highest = std::max(highest, bench.head().z);
    });
    bench.printer.home();
    EXPECT_GT(highest, 24.9);
    EXPECT_LT(highest, 30.1) << "10 mm, and homing's own 5";
    EXPECT_EQ(bench.printer.origin(), Printer::Origin::homed);
  }
}

TEST(MachineState, SoftEndstopsThatWouldCutThePlanAreNamed) {
  PrinterBench bench(running_rig({.bed = {235, 150, 250}}));
  bench.printer.home();
  EXPECT_ERROR(run_palpation(bench.printer, {.passes = 1}), OutsideLimits,
               "its soft endstops (M211) would cut the way to X99.70 Y209.17");
}

TEST(MachineState, AKlipperThatStartsIsWaitedFor) {
  ReadyBench bench(running_rig({.firmware = Firmware::klipper, .starts_s = 25}));
  EXPECT_NEAR(bench.rig.now(), 1025, 3);
  SimulatedRig rig(running_rig({.firmware = Firmware::klipper, .starts_s = 1e6}));
  const auto port = rig.printer_port();
  Printer printer(*port);
  EXPECT_ERROR(printer.connect(), PrinterRefused, "!! Printer is not ready");
  EXPECT_LT(rig.now(), 1070);
}

TEST(MachineState, TheCauseOfAShutdownIsQuoted) {
  PrinterBench bench(running_rig({.firmware = Firmware::klipper}));
  bench.firmware().inject(
      "// MCU 'mcu' shutdown: Timer too close\n// This often indicates the host computer is overloaded. "
      "Check\n"
      "// Once the underlying issue is corrected, use the\n// Printer is shutdown\n"
      "!! MCU 'mcu' shutdown: Timer too close\nok\n");
  EXPECT_ERROR(bench.printer.link().idle(1), PrinterHalted, "('// MCU 'mcu' shutdown: Timer too close'");
}

/// A collection into whose slide something is said, or happens, once.
struct Interrupted {
  explicit Interrupted(const VirtualPrinterSettings& firmware,
                       const std::function<void(PrinterBench&)>& plant)
      : bench(running_rig(firmware)) {
    outcome = bench.run({.passes = 2}, [&] { planted_s = bench.rig.now(), plant(bench); });
  }
  ReadyBench bench;
  double planted_s = 0;
  PalpationOutcome outcome;
};

TEST(MachineState, WhatTheDisplaySaysEndsTheRunFingerUp) {
  for (const char* said : {"//action:cancel", "// action:cancel", "//action:pause", "//action:paused",
                           "//  action: out_of_filament T0", "//action:stop", "//action:print_abort",
                           "X:1.00 //action:cancel", "ok P15 // action:cancelled"}) {
    Interrupted run({}, [said](PrinterBench& bench) { bench.firmware().inject(std::string(said) + "\n"); });
    EXPECT_EQ(run.outcome.finger, PalpationOutcome::Finger::lifted) << run.outcome.note;
    EXPECT_ERROR(std::rethrow_exception(run.outcome.error), PrinterPaused, "action:");
    EXPECT_GT(run.bench.head().z, 96);
    EXPECT_LT(run.bench.rig.now() - run.planted_s, 4) << said;
    EXPECT_LT(run.bench.head().y, 122);
  }
  // In the same read as the complaint of a damaged line, and as the answer to it that was sent again.
  using Changes = std::vector<Tampering::Change>;
  const Tampering::Change cancelled = {"ok\n", "ok\n//action:cancel\n"};
  for (const Changes& changes : {Changes{cancelled}, Changes{{"Resend", "Resend"}, cancelled}}) {
    Interrupted run({}, [&changes](PrinterBench& bench) {
      bench.port.to_printer = {{"M0114", "M0115"}};
      bench.port.from_printer = changes;
    });
    EXPECT_EQ(run.bench.port.to_printer.size(), 0U);
    EXPECT_EQ(run.bench.port.from_printer.size(), 0U);
    EXPECT_EQ(run.outcome.finger, PalpationOutcome::Finger::lifted) << run.outcome.note;
    EXPECT_ERROR(std::rethrow_exception(run.outcome.error), PrinterPaused, "action:");
    EXPECT_LT(run.bench.head().y, 122);
  }
  Interrupted other({}, [](PrinterBench& b) { b.firmware().inject("//action:notification Printing\n"); });
  EXPECT_TRUE(other.outcome.complete);
}

TEST(MachineState, APauseInContactIsAnsweredAndTheFingerLifted) {
  Interrupted run({}, [](PrinterBench& bench) { bench.firmware().pause_behind_move(bench.rig.now()); });
  EXPECT_EQ(run.outcome.finger, PalpationOutcome::Finger::lifted) << run.outcome.note;
  EXPECT_GT(run.bench.head().z, 96);
}

TEST(MachineState, AHeatersErrorEndsARunOnlyWhereTheMachineHalts) {
  Interrupted goes_on({}, [](PrinterBench& bench) {
    bench.firmware().inject("Error:Heater_ID: E0 temperature out of range\n T:25.00 /0.00\nB:25.00 /0.00\n");
  });
  EXPECT_TRUE(goes_on.outcome.complete) << goes_on.outcome.note;
  Interrupted halts({}, [](PrinterBench& bench) { bench.firmware().overheat(bench.rig.now()); });
  EXPECT_ERROR(std::rethrow_exception(halts.outcome.error), PrinterHalted,
               "MAXTEMP triggered, system stopped! Heater_ID: E0");
}

TEST(MachineState, AQuoteIsMatchedWhereItStands) {
  ReadyBench bench;
  bench.port.from_printer = {{"ok\n", "echo:Unknown command: \"1813\"M0114 R\"\nok\n"}};
  EXPECT_NO_THROW(bench.printer.link().command("M114 R"));
  EXPECT_GT(bench.printer.link().repeats(), 0U) << "what was damaged is asked for again";
}

TEST(MachineState, AFasterOrSlowerMachineIsNamedByItsSpeed) {
  for (const double slowness : {0.5, 0.66, 0.9, 1.1, 2.0}) {
    const FaultVerdict verdict =
        run_faulty_collection(running_rig({.slowness = slowness}), {.passes = 1, .slide = 60}, kLowDown);
    EXPECT_EQ(verdict.broken + verdict.doubt + verdict.error, "") << slowness;
    EXPECT_NEAR(verdict.named_mm_s * slowness, 10, 0.15) << slowness;
    EXPECT_LT(verdict.worst_mm, 0.1) << slowness;
  }
}

TEST(MachineState, AnotherAccelerationIsMeasured) {
  for (const double acceleration : {150.0, 500.0, 1000.0, 3000.0})
    for (const double speed : {5.0, 10.0, 25.0, 50.0}) {
      const FaultVerdict verdict =
          run_faulty_collection(running_rig({.realtime_position = false, .acceleration = acceleration}),
                                {.passes = 1, .slide = 60, .speed = speed}, kLowDown);
      EXPECT_EQ(verdict.broken + verdict.error, "") << acceleration << ", " << speed;
      EXPECT_LT(verdict.worst_mm, speed < 50 ? 0.3 : 0.5) << acceleration << ", " << speed;
      if (speed < 25) {
        EXPECT_EQ(verdict.doubt, "") << acceleration << ", " << speed;
      }
    }
}

}  // namespace supertac::machine_state_test
