#include "data/plates/plate.h"

#include "data/plates/plate_mesh.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::plate_file_test {

void write_plate(const std::string& path, const std::string& name) {
  write_file(path, stl_bytes(mesh_of(Plate::named(name), {.resolution_mm = 0.25}), name));
}

TEST(PlateFile, NamedReadsAnStlFileAndDropsItsFolder) {
  const TemporaryFolder folder;
  write_plate(folder / "my.stl", "6_Bumps");
  const Plate plate = Plate::named(folder / "my.stl");
  EXPECT_EQ(plate.name(), "my.stl");
  EXPECT_NEAR(plate.height(18, 39), 2.5, 1e-3);
  EXPECT_EQ(plate.crests().size(), 6u);
  EXPECT_EQ(what_of<FileError>([&] { Plate::named(folder / "other.stl"); }),
            folder / "other.stl" + ": cannot open the file: No such file or directory; check the name");
}

TEST(PlateFile, IsKeptBesideTheRecordingsAndNeverReplacedByAnother) {
  const TemporaryFolder folder;
  make_directories(folder / "out");
  write_plate(folder / "my.stl", "6_Bumps");
  keep_plate_file("6_Bumps", folder / "out");
  keep_plate_file(folder / "my.stl", folder / "out");
  keep_plate_file(folder / "my.stl", folder / "out");
  EXPECT_EQ(plate_in_folder("my.stl", folder / "out").crests().size(), 6u);
  EXPECT_EQ(plate_in_folder("3_Bumps", folder / "out").name(), "3_Bumps");
  write_plate(folder / "my.stl", "3_Bumps");
  EXPECT_EQ(what_of<FileError>([&] { keep_plate_file(folder / "my.stl", folder / "out"); }),
            folder / "out/my.stl" + ": is another plate than " + folder / "my.stl" +
                "; rename one of them or choose another folder");
}

TEST(PlateFile, ARecordingMayNotNameAFileElsewhere) {
  const TemporaryFolder folder;
  write_plate(folder / "my.stl", "6_Bumps");
  const auto refused = [&](const std::string& name, const std::string& in) {
    EXPECT_EQ(what_of<std::invalid_argument>([&] { plate_in_folder(name, in); }),
              "plate '" + name + "': expected the name of an STL file beside the recordings, found a path");
  };
  refused("../" + folder.path() + "/my.stl", folder.path());
  refused(folder / "my.stl", ".");
}

TEST(PlateFile, WindowsTakeTheirTruthFromIt) {
  const TemporaryFolder folder;
  write_plate(folder / "my.stl", "4_Blob");
  Recording recording = make_recording({.plate = "my.stl", .frames = 300});
  write_recording(folder / "a.safetensors", recording);
  const WindowSet set = WindowSet::load(folder.path(), {}, {.timesteps = 32});
  recording.plate = "4_Blob";
  WindowSet named({.timesteps = 32});
  named.add(recording);
  ASSERT_EQ(set.size(), named.size());
  std::vector<float> truth(256), expected(256);
  for (std::size_t i = 0; i < set.size(); i += 50) {
    set.truth(i, truth);
    named.truth(i, expected);
    double squares = 0;  // the foot of a blob is upright: single pixels there may differ by .1
    for (std::size_t k = 0; k < truth.size(); ++k) squares += std::pow(double{truth[k] - expected[k]}, 2);
    EXPECT_LT(std::sqrt(squares / 256), 0.02) << i;
  }
  const std::string before = set.fingerprint();
  write_plate(folder / "my.stl", "6_Blob");  // another plate of the same name is other data
  EXPECT_NE(WindowSet::load(folder.path(), {}, {.timesteps = 32}).fingerprint(), before);
}

}  // namespace supertac::plate_file_test
