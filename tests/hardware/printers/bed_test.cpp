#include "hardware/printers/palpation.h"

#include <nlohmann/json.hpp>

#include "io/files/file.h"
#include "tests/support/test.h"

namespace supertac::bed_test {

constexpr const char* kLeast = R"({"plate": [60, 40, 30], "origin": [60, 40, 70], "high": [180, 180, 180]})";

TEST(Bed, WhatAFileLeavesOutIsAsOnTheRig) {
  const Bed bed = bed_of_json(kLeast, "b.json");
  EXPECT_EQ(bed.origin, (Point3{60, 40, 70}));
  EXPECT_EQ(bed.limits.plate, (Point3{60, 40, 30}));
  EXPECT_EQ(bed.limits.high, (Point3{180, 180, 180}));
  EXPECT_EQ(bed.plan.start, (Point3{60.5, 40, 30}));
  Bed rest = bed;
  rest.origin = Bed{}.origin, rest.limits = Bed{}.limits, rest.plan.start = Bed{}.plan.start;
  EXPECT_EQ(rest, Bed{});
  EXPECT_NO_THROW(legs_of(bed.plan, bed.origin, bed.limits));
}

TEST(Bed, WhatIsWrittenIsReadAgain) {
  Bed bed = bed_of_json(kLeast, "b.json");
  bed.limits.low = {-1.5, -2, 0.25};
  bed.plan.start.x = 63;
  bed.plan.shift_x = -2.5, bed.plan.passes = 3, bed.plan.slide = 80.1, bed.plan.lift = 7,
  bed.plan.speed = 4.5;
  bed.baud = 250'000;
  EXPECT_EQ(bed_of_json(json_of(bed).dump(), "again"), bed);
  EXPECT_EQ(bed_of_json(json_of(Bed{}).dump(), "rig"), Bed{});
}

TEST(Bed, AMessageNamesTheKey) {
  const auto with = [](const std::string& more) {
    std::string text = kLeast;
    return bed_of_json(text.insert(1, more + ", "), "b.json");
  };
  EXPECT_ERROR(
      bed_of_json("{}", "b.json"), FileError,
      "b.json: has no \"plate\": expected three numbers of mm within 10000, [x, y, z] of the printer");
  EXPECT_ERROR(with(R"("low": [0, 0])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": [])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": [0, 0, 1e9])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": 3)"), FileError, "\"low\" must be a list of numbers, found 3");
  EXPECT_ERROR(with(R"("speed_mm_s": 51)"), FileError, "\"speed_mm_s\" must be 0.5 to 50, found 51");
  EXPECT_ERROR(with(R"("slide_mm": 109)"), FileError, "\"slide_mm\" must be 1 to 108, found 109");
  EXPECT_ERROR(with(R"("passes": 2.5)"), FileError, "\"passes\" must be a whole number, found 2.5");
  for (const char* baud : {"9", "1e5", "100000001"})
    EXPECT_ERROR(with(R"("baud": )" + std::string(baud)), FileError,
                 "\"baud\" must be a whole number from 50 to 100000000, found ");
  EXPECT_EQ(with(R"("baud": 2000000)").baud, 2'000'000U);
  EXPECT_ERROR(with(R"("sped": 9)"), FileError, "knows no key 'sped'; it may have plate, origin");
  EXPECT_ERROR(bed_of_json("[", "b.json"), FileError, "b.json");
}

// Beside this plate the head is as free, and over it as low, as beside and over the rig's.
TEST(Bed, TheLimitsMoveWithThePlate) {
  const Limits here, there{.low = {-500, -500, -100}, .high = {900, 900, 900}, .plate = {300.2, 1.17, -8.19}};
  EXPECT_DOUBLE_EQ(here.clearance_z(), 95);
  EXPECT_DOUBLE_EQ(there.clearance_z(), -5);
  const auto allowed = [](const Limits& limits, double x, double y, double z) {
    try {
      limits.check_target({x, y, z});
      return true;
    } catch (const std::exception&) {
      return false;
    }
  };
  for (const double x : {96.99, 97.01, 138.49, 138.51})
    for (const double y : {98.99, 99.01, 211.49, 211.51})
      for (const double z : {94.9, 95.1}) {
        const bool free = z > 95 || (x > 97 && x < 138.5 && y > 99 && y < 211.5);
        EXPECT_EQ(allowed(here, x, y, z), free) << x << " " << y << " " << z;
        EXPECT_EQ(allowed(there, x + 201, y - 100, z - 100), free) << x << " " << y << " " << z;
      }
}

TEST(Bed, TheExampleIsRead) {
  const Bed bed = read_bed(SUPERTAC_SOURCE "/examples/beds/mini_printer.json");
  EXPECT_NO_THROW(legs_of(bed.plan, bed.origin, bed.limits));
}

}  // namespace supertac::bed_test
