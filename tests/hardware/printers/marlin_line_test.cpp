#include "hardware/printers/marlin_link.h"
#include "tests/hardware/virtual_rig/virtual_printer.h"
#include "tests/support/test.h"

namespace supertac::marlin_line_test {

TEST(MarlinLine, NumberedLineCarriesItsXor) {
  // 'N'^'1'^' '^'M'^'1'^'1'^'5' by hand: 0x26 = 38
  EXPECT_EQ(numbered_line(0, "M110 N0"), "N0 M110 N0*125\n");
  EXPECT_EQ(numbered_line(1, "M115"), "N1 M115*39\n");
}

TEST(MarlinLine, AnMCodeIsShieldedFromTheEmergencyParser) {
  EXPECT_EQ(shielded("M114 R"), "M0114 R");
  EXPECT_EQ(shielded("M400"), "M0400");
  EXPECT_EQ(shielded("M110 N0"), "M110 N0");
  EXPECT_EQ(shielded("G1 X1"), "G1 X1");
}

// Every line the drivers send in a run, with every single byte dropped, every bit flipped, every byte
// inserted: the emergency parser, which sees no checksum, neither halts nor stops. Line numbers that contain
// 112 or 410 are left out: an M in front of these digits is obeyed, and no host can keep it from Marlin.
TEST(MarlinLine, NoSingleDamagedByteIsAnEmergency) {
  const std::vector<std::string> commands = {"M114",
                                             "M114 R",
                                             "M400",
                                             "M115",
                                             "G90",
                                             "G92 X99.700 Y101.170 Z131.810",
                                             "G1 X99.700 Y209.170 Z91.810 F600.0"};
  VirtualPrinter printer({}, 0, true);
  printer.receive("G1 X1000000 F60\n", 0);
  printer.advance(1);
  const auto unharmed = [&](const std::string& line) {
    printer.receive(line, 1);
    return !printer.halted() && printer.moving(1);
  };
  for (const std::int64_t number : {1, 4, 11, 41, 114, 1400, 21012}) {
    for (const std::string& command : commands) {
      const std::string line = numbered_line(number, shielded(command));
      for (std::size_t at = 0; at < line.size(); ++at) {
        std::string dropped = line;
        EXPECT_TRUE(unharmed(dropped.erase(at, 1) + "\n")) << line << "dropped " << at;
        for (int value = 0; value < 256; ++value) {
          std::string changed = line, inserted = line;
          if (value < 8) changed[at] = static_cast<char>(changed[at] ^ (1 << value));
          ASSERT_TRUE(unharmed(changed + "\n")) << line << "flipped " << at << ", bit " << value;
          ASSERT_TRUE(unharmed(inserted.insert(at, 1, static_cast<char>(value)) + "\n"))
              << line << "inserted " << value << " at " << at;
        }
      }
    }
  }
  EXPECT_FALSE(unharmed("N5 M1124*0\n")) << "the test's firmware has no emergency parser";
}

TEST(MarlinLine, RefusesWhatMarlinWouldCut) {
  EXPECT_REFUSAL("marlin line: command expects a line of at most 96 bytes, got 103 for '" +
                     std::string(60, 'X') + "...'",
                 numbered_line(1, std::string(96, 'X')));
  EXPECT_REFUSAL("marlin line: command expects neither a line break nor '*', got 'G1 X1?G1 X2'",
                 numbered_line(1, "G1 X1\nG1 X2"));
  EXPECT_ERROR(numbered_line(1, "G1*3"), std::invalid_argument, "got 'G1*3'");
}

TEST(MarlinLine, RepliesAreClassified) {
  using enum ReplyKind;
  const std::pair<const char*, ReplyKind> lines[] = {
      {"ok", ok},
      {"ok N0 P15 B3", ok},
      {"ok T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0", ok},
      {"okay", other},
      {"start", start},
      {"wait", wait},
      {"echo:busy: processing", busy},
      {"echo:busy: paused for user", paused},
      {"echo:Unknown command: \"1 G1\"", unknown_command},
      {"Error:Printer halted. kill() called!", fatal},
      {"Error:Thermal Runaway, system stopped! Heater_ID: 0", fatal},
      // Said unasked, in the middle of an answer.
      {"ok N3 Error:Printer halted. kill() called!", fatal},
      {"X:1.00 echo:busy: paused for user", paused}};
  for (const auto& [line, kind] : lines) EXPECT_EQ(parse_reply(line).kind, kind) << line;
  for (const char* said : {"//action:resumed", "//action:notification stop", "echo:action:cancel"})
    EXPECT_NE(parse_reply(said).kind, interrupted) << said;
  EXPECT_EQ(parse_reply("Resend: 13").number, 13);
  EXPECT_EQ(parse_reply("Error:checksum mismatch, Last Line: 12").number, 12);
  EXPECT_EQ(parse_reply("Error:checksum mismatch, Last Line: 1x").number, std::nullopt);
}

TEST(MarlinLine, ADamagedPositionIsNoPosition) {
  const Reply good = parse_reply("X:99.70 Y:-1.17 Z:91.81 E:0.00 Count X:7976 Y:8094 Z:36724");
  ASSERT_EQ(good.kind, ReplyKind::position);
  EXPECT_EQ(good.position, (Point3{99.70, -1.17, 91.81}));
  EXPECT_EQ(parse_reply("X:9970 Y:101.17 Z:91.81 E:0.00").kind, ReplyKind::other);
  EXPECT_EQ(parse_reply("X:99.70 Y:101.1 Z:91.81 E:0.00").kind, ReplyKind::other);
  EXPECT_EQ(parse_reply("X:99.70 Y:101.17 ").kind, ReplyKind::other);
}

}  // namespace supertac::marlin_line_test
