#include <nlohmann/json.hpp>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::rig_plate_test {

using PlateProgram = ProgramTest;

TEST_F(PlateProgram, WritesThePlate) {
  for (const std::string name : {"bumps6", "waves6h1", "4_Ridges", "bumps12+ridges4+waves6+blobs6"}) {
    const std::string file = name + ".stl";
    const ProcessResult made = succeed("supertac-plate --json - --plate " + name + " --out " + file);
    const auto json = nlohmann::json::parse(made.out);
    const Plate plate = Plate::named(path(file));
    EXPECT_NEAR(plate.max_height(), json["stl"]["max_height_mm"], 0.13) << name;
  }
}

TEST_F(PlateProgram, RefusesWhatItCannotPrint) {
  EXPECT_EQ(run("supertac-plate --plate bumps6").code, 2);
  const std::string into = "supertac-plate --out x.stl --plate ";
  expect_failure(run(into + "lumps6"), 2,
                 "supertac-plate: --plate: plate \"lumps6\": unknown texture \"lumps6\"; expected ");
  EXPECT_EQ(run(into + "blobs6h9").code, 2);
  EXPECT_EQ(run(into + "no.stl").code, 1);
  write_file(path("x.stl"), "solid nothing\nendsolid");
  EXPECT_EQ(run(into + "bumps6").code, 1) << "no --force";
  expect_exit(run("supertac-plate --plate x.stl --out y.stl"), 1, "holds no triangle");
}

TEST_F(PlateProgram, APrintedPlateIsSimulatedAndImportedLikeANamedOne) {
  succeed("supertac-plate --plate 6_Ridges --out my.stl");
  succeed("supertac-simulate --plates my.stl --out sim --speeds 10 --trials 1 --passes 1");
  const Recording recording = read_recording(path("sim/my.stl_t1_p1_v10.safetensors"));
  EXPECT_GT(WindowSet::load(path("sim"), {}, {.timesteps = 32}).size(), 1000u);

  // The same pass as the rig's text, in a folder named like the plate's file.
  make_directories(path("text/my/1"));
  write_file(path("text/my/1/1.txt"), text_of(recording));
  std::filesystem::copy(path("my.stl"), path("text/my.stl"));
  succeed("supertac-import text --out imported");
  EXPECT_EQ(read_recording(path("imported/my.stl_t1_p1_v10.safetensors")).plate, "my.stl");
  EXPECT_TRUE(std::filesystem::exists(path("imported/my.stl")));
}

}  // namespace supertac::rig_plate_test
