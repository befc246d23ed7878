#include "hardware/printers/palpation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "hardware/ports/errors.h"
#include "hardware/printers/limits.h"
#include "hardware/printers/marlin_link.h"
#include "tests/expect_error.h"
#include "tests/hardware/rig_support.h"

namespace supertac {
namespace {

using rig::kMounted;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

Point3 target_of(const std::string& line) {
  Point3 p;
  EXPECT_EQ(std::sscanf(line.c_str(), "G1 X%lf Y%lf Z%lf", &p.x, &p.y, &p.z), 3) << line;
  return p;
}

std::vector<std::string> moves_in(const std::string& program) {
  std::vector<std::string> moves;
  for (const std::string& line : lines_of(program))
    if (line.starts_with("G1")) moves.push_back(line);
  return moves;
}

TEST(PalpationProgram, MovesAreThoseTheRunSends) {
  PrinterBench bench;
  bench.printer.confirm_origin(kMounted);
  const PalpationPlan plan{.passes = 3, .speed = 5};
  ASSERT_TRUE(Palpation(bench.printer, plan).run().complete);
  EXPECT_EQ(moves_in(palpation_program(plan, kMounted, "x")), moves_of(bench.firmware()));
}

TEST(PalpationProgram, IsAbsoluteWithinLimitsAndEndsLifted) {
  const PalpationPlan plan;
  const std::string program = palpation_program(plan, kMounted, "6_Ridges");
  const auto lines = lines_of(program);
  EXPECT_EQ(lines[0], "; 6_Ridges");
  const auto at = [&](const std::string& line) {
    return std::find(lines.begin(), lines.end(), line) - lines.begin();
  };
  const auto first_move =
      std::find_if(lines.begin(), lines.end(), [](const auto& l) { return l.starts_with("G1"); }) -
      lines.begin();
  for (const char* before : {"G21", "G90", "G92 X99.700 Y101.170 Z131.810"})
    EXPECT_LT(at(before), first_move);
  EXPECT_EQ(std::count(lines.begin(), lines.end(), "G91"), 0);
  Point3 here = kMounted;
  int slides = 0;
  for (const std::string& move : moves_in(program)) {
    const Point3 to = target_of(move);
    EXPECT_NO_THROW(Limits{}.check_path(here, to)) << move;
    const bool sideways = here.x != to.x;
    if (sideways) {
      EXPECT_GE(std::min(here.z, to.z), plan.start.z + plan.lift) << move;
    }
    if (here.y != to.y && to.z < Limits{}.clearance_z()) {
      ++slides;
      EXPECT_NEAR(to.y - here.y, 108, 1e-9);
      EXPECT_TRUE(move.ends_with(" F600.0")) << move;
    }
    if (here.z != to.z) {
      EXPECT_TRUE(move.ends_with(" F300.0")) << move;  // z at most 5 mm/s
    }
    here = to;
  }
  EXPECT_EQ(slides, 8);
  EXPECT_EQ(here, kMounted);
  EXPECT_EQ(lines.back(), "M400");
}

// A default Marlin has neither display nor emergency parser and knows no M0: there the 20 s of G4 are the
// pause, and the file says so. RealMarlin.TheProgramPausesOnEveryFirmware runs it.
TEST(PalpationProgram, SaysWhatItsPauseNeeds) {
  const std::string program = palpation_program({}, kMounted, "x");
  EXPECT_NE(program.find("G4 leaves 20 s to switch it off"), std::string::npos);
  EXPECT_NE(program.find("until the host sends M108"), std::string::npos);
  EXPECT_LT(program.find("\nM0 "), program.find("\nG4 S20\n"));
  EXPECT_LT(program.find("\nG4 S20\n"), program.find("\nG92 "));
}

TEST(PalpationProgram, RefusesWhatTheRunRefuses) {
  EXPECT_ERROR(palpation_program({.passes = 40}, kMounted, "x"), OutsideLimits,
               "below Z95.00 and beside the plate; nothing was sent, lift first");
  EXPECT_ERROR(palpation_program({.passes = 0}, kMounted, "x"), std::invalid_argument,
               "expected 1 to 1000 passes");
  EXPECT_ERROR(palpation_program({}, {99.7, 101.17, 500}, "x"), OutsideLimits,
               "Z expected 0.00 to 250.00 mm, found 500.00; nothing was sent");
  EXPECT_ERROR(palpation_program({}, kMounted, "a\nG28"), std::invalid_argument,
               "the title has a line break");
}

}  // namespace
}  // namespace supertac
