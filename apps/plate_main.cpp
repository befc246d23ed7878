// supertac-plate: a plate as STL, to print, and the palpation run as G-code, to send from another host.

#include "apps/common/command_line/program.h"
#include "data/plates/plate_mesh.h"
#include "hardware/printers/palpation.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

nlohmann::ordered_json write_stl(const Arguments& arguments, const Plate& plate) {
  const std::string path = arguments.text("out");
  const auto triangles = mesh_of(plate, {.resolution_mm = arguments.number("resolution", 0.02, 5)});
  // Named after no file: the same plate, however it is called, gives the same bytes.
  const std::string name = Plate::is_file(plate.name()) ? "read from STL" : plate.name();
  const auto bytes =
      read_option("resolution", [&] { return stl_bytes(triangles, "SuperTac plate " + name + ", mm"); });
  write_file(arguments.output("out"), bytes);
  arguments.print(path + ": " + plate.name() + ", heights " + format(plate.min_height(), 2) + " to " +
                  format(plate.max_height(), 2) +
                  " mm, texture from y = " + format(plate.texture_begin(), 2) + " to " +
                  format(plate.texture_end(), 2) + " mm, " + std::to_string(triangles.size()) + " triangles");
  return {{"file", path},
          {"triangles", triangles.size()},
          {"min_height_mm", plate.min_height()},
          {"max_height_mm", plate.max_height()},
          {"texture_from_mm", plate.texture_begin()},
          {"texture_to_mm", plate.texture_end()}};
}

nlohmann::ordered_json write_gcode(const Arguments& arguments, const Plate& plate) {
  const std::string path = arguments.text("gcode");
  PalpationPlan plan;
  plan.speed = arguments.number("speed", 0.5, rig::kFastestMmS);
  plan.passes = static_cast<int>(arguments.integer("passes", 1, rig::kPasses));
  const std::string title = "SuperTac: " + std::to_string(plan.passes) + " passes over plate " +
                            plate.name() + " at " + format(plan.speed) + " mm/s";
  write_file(arguments.output("gcode"), palpation_program(plan, rig::kMounted, title));
  arguments.print(path + ": " + std::to_string(plan.passes) + " passes at " + format(plan.speed) +
                  " mm/s, from and back to " + describe(rig::kMounted));
  return {{"file", path}, {"passes", plan.passes}, {"speed_mm_s", plan.speed}};
}

}  // namespace

void declare(Arguments& arguments) {
  arguments
      .required("plate", "NAME",
                "a plate of the rig (6_Ridges), kind and pitch in mm (ridges5), with a height "
                "(ridges5h1.5), several (bumps12+ridges4), or FILE.stl")
      .option("out", "FILE", "the plate as binary STL in mm, 36 x 108 in x and y, its flat part at z = 0")
      .writes()
      .option("resolution", "MM", "distance of the points where the surface is exact", "0.125")
      .option("gcode", "FILE", "the palpation run over it, for a Marlin printer and any host")
      .writes()
      .option("speed", "MM_PER_S", "of the slides, for --gcode", "10")
      .option("passes", "N", "slides, 5 mm apart in x (at most 8), for --gcode", "8");
}

int run(Arguments& arguments) {
  if (!arguments.given("out") && !arguments.given("gcode"))
    throw UsageError("--out: expected a file for the plate (or --gcode one for the run), found neither");
  const Plate plate = read_option("plate", [&] { return Plate::named(arguments.text("plate")); });
  nlohmann::ordered_json result{{"plate", plate.name()}};
  if (arguments.given("out")) result["stl"] = write_stl(arguments, plate);
  if (arguments.given("gcode")) result["gcode"] = write_gcode(arguments, plate);
  arguments.write_json(result);
  return kExitOk;
}

}  // namespace supertac
