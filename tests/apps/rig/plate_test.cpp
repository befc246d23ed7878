#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

TEST(PlateProgram, WritesThePlateAndTheRun) {
  const TemporaryFolder folder;
  for (const char* name : {"bumps6", "waves6h1", "4_Ridges", "bumps12+ridges4+waves6+blobs6"}) {
    const std::string file = folder / (std::string(name) + ".stl");
    const auto made = run_process("supertac-plate", {"--plate", name, "--resolution", "0.5", "--out", file,
                                                     "--gcode", file + ".gcode", "--json", "-"});
    ASSERT_EQ(made.code, 0) << made.error;
    const auto json = nlohmann::json::parse(made.out);
    const Plate plate = Plate::named(file);
    EXPECT_NEAR(plate.max_height(), json["stl"]["max_height_mm"], 0.13) << name;
    EXPECT_NE(read_text_file(file + ".gcode", 1 << 20).find("; SuperTac: 8 passes"), std::string::npos);
  }
}

TEST(PlateProgram, RefusesWhatItCannotPrint) {
  const TemporaryFolder folder;
  const std::string out = folder / "x.stl";
  EXPECT_EQ(run_process("supertac-plate", {"--plate", "bumps6"}).code, 2);
  const auto unknown = run_process("supertac-plate", {"--plate", "lumps6", "--out", out});
  EXPECT_EQ(unknown.code, 2);
  const std::string refusal =
      "supertac-plate: --plate: plate \"lumps6\": unknown texture \"lumps6\"; expected ";
  EXPECT_TRUE(unknown.error.starts_with(refusal)) << unknown.error;
  EXPECT_EQ(run_process("supertac-plate", {"--plate", "blobs6h9", "--out", out}).code, 2);
  EXPECT_EQ(run_process("supertac-plate", {"--plate", folder / "no.stl", "--out", out}).code, 1);
  write_file(out, std::string("solid nothing\nendsolid"));
  EXPECT_EQ(run_process("supertac-plate", {"--plate", "bumps6", "--out", out}).code, 1) << "no --force";
  const auto bad = run_process("supertac-plate", {"--plate", out, "--gcode", folder / "x.gcode"});
  EXPECT_EQ(bad.code, 1);
  EXPECT_NE(bad.error.find("holds no triangle"), std::string::npos) << bad.error;
}

TEST(PlateProgram, APrintedPlateIsSimulatedAndImportedLikeANamedOne) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_process("supertac-plate", {"--plate", "6_Ridges", "--out", folder / "my.stl"}).code, 0);
  const auto simulated =
      run_process("supertac-simulate", {"--plates", folder / "my.stl", "--out", folder / "sim", "--speeds",
                                        "10", "--trials", "1", "--passes", "1"});
  ASSERT_EQ(simulated.code, 0) << simulated.error;
  const Recording recording = read_recording(folder / "sim/my.stl_t1_p1_v10.safetensors");
  EXPECT_GT(WindowSet::load(folder / "sim", {}, {.timesteps = 32}).size(), 1000u);

  // The same pass as the rig's text, in a folder named like the plate's file.
  std::string text;
  for (std::size_t i = 0; i < recording.volts.size(); ++i)
    text += std::to_string(recording.volts[i]) + (i % kTaxels == kTaxels - 1 ? "\n" : " ");
  make_directories(folder / "text/my/1");
  write_file(folder / "text/my/1/1.txt", text);
  std::filesystem::copy(folder / "my.stl", folder / "text/my.stl");
  const auto imported = run_process("supertac-import", {folder / "text", "--out", folder / "imported"});
  ASSERT_EQ(imported.code, 0) << imported.error;
  EXPECT_EQ(read_recording(folder / "imported/my.stl_t1_p1_v10.safetensors").plate, "my.stl");
  EXPECT_TRUE(std::filesystem::exists(folder / "imported/my.stl"));
}

}  // namespace
}  // namespace supertac
