#include "hardware/marlin_line.h"

#include <gtest/gtest.h>

#include <clocale>

namespace supertac {
namespace {

TEST(MarlinLine, NumberedLineCarriesItsXor) {
  // 'N'^'1'^' '^'M'^'1'^'1'^'5' by hand: 0x26 = 38
  EXPECT_EQ(numbered_line(0, "M110 N0"), "N0 M110 N0*125\n");
  EXPECT_EQ(numbered_line(1, "M115"), "N1 M115*39\n");
}

TEST(MarlinLine, RefusesWhatMarlinWouldCut) {
  EXPECT_THROW(numbered_line(1, std::string(96, 'X')), std::invalid_argument);
  EXPECT_THROW(numbered_line(1, "G1 X1\nG1 X2"), std::invalid_argument);
  EXPECT_THROW(numbered_line(1, "G1*3"), std::invalid_argument);
}

TEST(MarlinLine, DecimalsAreFixedInEveryLocale) {
  EXPECT_EQ(fixed_decimals(1e-7, 3), "0.000");
  EXPECT_EQ(fixed_decimals(12345678.5, 2), "12345678.50");
  EXPECT_THROW(fixed_decimals(1.0 / 0.0, 2), std::invalid_argument);
}

TEST(MarlinLine, RepliesAreClassified) {
  EXPECT_EQ(parse_reply("ok").kind, ReplyKind::ok);
  EXPECT_EQ(parse_reply("ok P15 B3").kind, ReplyKind::ok);
  EXPECT_EQ(parse_reply("okay").kind, ReplyKind::other);
  EXPECT_EQ(parse_reply("Resend: 13").number, 13);
  EXPECT_EQ(parse_reply("Error:checksum mismatch, Last Line: 12").number, 12);
  EXPECT_EQ(parse_reply("Error:checksum mismatch, Last Line: 1x").number, std::nullopt);
  EXPECT_EQ(parse_reply("Error:Printer halted. kill() called!").kind, ReplyKind::fatal);
  EXPECT_EQ(parse_reply("Error:Thermal Runaway, system stopped! Heater_ID: 0").kind, ReplyKind::fatal);
  EXPECT_EQ(parse_reply("echo:busy: processing").kind, ReplyKind::busy);
  EXPECT_EQ(parse_reply("echo:busy: paused for user").kind, ReplyKind::paused);
  EXPECT_EQ(parse_reply("echo:Unknown command: \"1 G1\"").kind, ReplyKind::unknown_command);
  EXPECT_EQ(parse_reply("start").kind, ReplyKind::start);
  EXPECT_EQ(parse_reply("wait").kind, ReplyKind::wait);
}

TEST(MarlinLine, ADamagedPositionIsNoPosition) {
  const Reply good = parse_reply("X:99.70 Y:-1.17 Z:91.81 E:0.00 Count X:7976 Y:8094 Z:36724");
  ASSERT_EQ(good.kind, ReplyKind::position);
  EXPECT_EQ(good.position, (Point3{99.70, -1.17, 91.81}));
  EXPECT_EQ(parse_reply("X:9970 Y:101.17 Z:91.81 E:0.00").kind, ReplyKind::other);
  EXPECT_EQ(parse_reply("X:99.70 Y:101.1 Z:91.81 E:0.00").kind, ReplyKind::other);
  EXPECT_EQ(parse_reply("X:99.70 Y:101.17 ").kind, ReplyKind::other);
}

}  // namespace
}  // namespace supertac
