#include "hardware/printers/palpation.h"

#include <algorithm>

#include "hardware/ports/serial_termios.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFarthest = 1e4;  // mm
constexpr const char* kPoint = "three numbers of mm within 10000, [x, y, z] of the printer";
constexpr int kMostPasses = 1000;

template <class Number>
Number within(JsonObject& keys, const char* name, double low, double high, Number value) {
  if (!(value >= low && value <= high)) keys.wrong(name, format(low) + " to " + format(high), Json(value));
  return value;
}

/// `fallback` nullptr: it has to be there.
Point3 take_point(JsonObject& keys, const char* name, const Point3* fallback) {
  const bool given = keys.find(name) != nullptr;
  if (!given && fallback != nullptr) return *fallback;
  if (!given) throw FileError(keys.where(), "has no \"" + std::string(name) + "\": expected " + kPoint);
  const std::vector<double> numbers = keys.numbers(name);
  const auto within = [](double v) { return v >= -kFarthest && v <= kFarthest; };
  if (numbers.size() != 3 || !std::ranges::all_of(numbers, within)) keys.wrong(name, kPoint, Json(numbers));
  return {numbers[0], numbers[1], numbers[2]};
}

unsigned take_baud(JsonObject& keys, unsigned fallback) {
  const Json* baud = keys.find("baud");
  if (baud == nullptr) return fallback;
  if (!baud->is_number_integer() || *baud < kLeastBaud || *baud > kMostBaud)
    keys.wrong("baud",
               "a whole number from " + std::to_string(kLeastBaud) + " to " + std::to_string(kMostBaud),
               *baud);
  return baud->get<unsigned>();
}

Json json_of(const Point3& p) { return {p.x, p.y, p.z}; }

}  // namespace

Bed bed_of_json(const std::string& text, const std::string& where) {
  Bed bed;
  PalpationPlan& plan = bed.plan;
  try {
    JsonObject keys(parse_json_limited(text), where);
    bed.limits.plate = take_point(keys, "plate", nullptr);
    bed.origin = take_point(keys, "origin", nullptr);
    bed.limits.high = take_point(keys, "high", nullptr);
    bed.limits.low = take_point(keys, "low", &bed.limits.low);
    plan.start = bed.limits.plate;
    plan.start.x +=
        within(keys, "first_x_mm", 0, rig::kPlateWidthMm, keys.number("first_x_mm", rig::pass_x_mm(1)));
    plan.shift_x = within(keys, "shift_mm", -rig::kPlateWidthMm, rig::kPlateWidthMm,
                          keys.number("shift_mm", plan.shift_x));
    plan.passes = within(keys, "passes", 1, kMostPasses, keys.integer("passes", plan.passes));
    plan.slide = within(keys, "slide_mm", 1, rig::kPlateLengthMm, keys.number("slide_mm", plan.slide));
    plan.lift = within(keys, "lift_mm", 1, 100, keys.number("lift_mm", plan.lift));
    plan.speed = within(keys, "speed_mm_s", 0.5, rig::kFastestMmS, keys.number("speed_mm_s", plan.speed));
    bed.baud = take_baud(keys, bed.baud);
    keys.no_others();
  } catch (const JsonError& error) {
    throw FileError(where, error.what());
  }
  return bed;
}

Bed read_bed(const std::string& path) {
  return bed_of_json(read_text_file(path, JsonLimits().max_bytes), path);
}

Json json_of(const Bed& bed) {
  const PalpationPlan& plan = bed.plan;
  return {{"plate", json_of(bed.limits.plate)},
          {"origin", json_of(bed.origin)},
          {"high", json_of(bed.limits.high)},
          {"low", json_of(bed.limits.low)},
          {"first_x_mm", plan.start.x - bed.limits.plate.x},
          {"shift_mm", plan.shift_x},
          {"passes", plan.passes},
          {"slide_mm", plan.slide},
          {"lift_mm", plan.lift},
          {"speed_mm_s", plan.speed},
          {"baud", bed.baud}};
}

}  // namespace supertac
