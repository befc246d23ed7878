// supertac-plate: a plate as STL, to print.

#include "apps/common/command_line/program.h"
#include "data/plates/stl.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
void declare(Arguments& arguments) {
  arguments
      .required("plate", "NAME",
                "a plate of the rig (6_Ridges), kind and pitch in mm (ridges5), with a height "
                "(ridges5h1.5), several (bumps12+ridges4), or FILE.stl")
      .required("out", "FILE", "the plate as binary STL in mm, 36 x 108 in x and y, its flat part at z = 0")
      .writes();
}

int run(Arguments& arguments) {
  const Plate plate = read_option("plate", [&] { return Plate::named(arguments.text("plate")); });
  const std::string path = arguments.text("out");
  const auto triangles = mesh_of(plate);
  // Named after no file: the same plate, however it is called, gives the same bytes.
  const std::string name = Plate::is_file(plate.name()) ? "read from STL" : plate.name();
  write_file(arguments.output("out"), stl_bytes(triangles, "SuperTac plate " + name + ", mm"));
  arguments.print(path + ": " + plate.name() + ", heights " + format(plate.min_height(), 2) + " to " +
                  format(plate.max_height(), 2) +
                  " mm, texture from y = " + format(plate.texture_begin(), 2) + " to " +
                  format(plate.texture_end(), 2) + " mm, " + std::to_string(triangles.size()) + " triangles");
  arguments.write_json({{"plate", plate.name()},
                        {"stl",
                         {{"file", path},
                          {"triangles", triangles.size()},
                          {"min_height_mm", plate.min_height()},
                          {"max_height_mm", plate.max_height()},
                          {"texture_from_mm", plate.texture_begin()},
                          {"texture_to_mm", plate.texture_end()}}}});
  return kExitOk;
}

}  // namespace supertac
