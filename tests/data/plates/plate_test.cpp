#include "data/plates/plate.h"

#include "data/plates/stl.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "io/numbers/hash.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::plate_test {

struct RigRow {
  const char* name;
  double begin, end, first, pitch;
  int count;
};

// Texture from-to, pitch and count as the rig's plates were made; first centre = from + half an element.
constexpr RigRow kRig[] = {
    {"3_Bumps", 39.5, 68.5, 42, 12, 3},     {"6_Bumps", 36.5, 71.5, 39, 6, 6},
    {"4_Ridges", 39.25, 68.75, 40.5, 9, 4}, {"6_Ridges", 37.75, 70.25, 39, 6, 6},
    {"4_Waves", 38.25, 69.75, 40.5, 9, 4},  {"6_Waves", 37.5, 70.5, 39, 6, 6},
    {"4_Blob", 38, 70, 40.5, 9, 4},         {"6_Blob", 36.5, 71.5, 39, 6, 6},
};

TEST(Plate, RigPlatesHaveTheirExtentAndEveryCrestIsWhereItBelongs) {
  for (const RigRow& row : kRig) {
    const Plate plate = Plate::named(row.name);
    EXPECT_EQ(plate.name(), row.name);
    EXPECT_NEAR(plate.texture_begin(), row.begin, 1e-9) << row.name;
    EXPECT_NEAR(plate.texture_end(), row.end, 1e-9) << row.name;
    EXPECT_EQ(plate.max_height(), 2.5) << row.name;
    const double x = row.pitch / 2;  // first column of the blob plates; no matter for the others
    for (int i = 0; i < row.count; ++i)
      EXPECT_NEAR(plate.height(x, row.first + i * row.pitch), 2.5, 1e-9) << row.name << " element " << i;
    EXPECT_EQ(plate.height(x, row.begin - 0.01), 0) << row.name;
    EXPECT_EQ(plate.height(x, row.end + 0.01), 0) << row.name;
    EXPECT_GT(plate.height(x, row.begin + 0.01), 0) << row.name;
    EXPECT_GT(plate.height(x, row.end - 0.01), 0) << row.name;
  }
}

TEST(Plate, ProfilesAreTriangleSemicircleSine) {
  const Plate ridges = Plate::named("4_Ridges"), bumps = Plate::named("3_Bumps"),
              waves = Plate::named("4_Waves");
  for (double d : {-1.2, -0.5, 0.3, 1.0}) {
    EXPECT_NEAR(ridges.height(9, 40.5 + d), 2.5 - 2 * std::abs(d), 1e-12);
    EXPECT_NEAR(bumps.height(9, 42 + d), std::sqrt(6.25 - d * d), 1e-12);
    EXPECT_NEAR(waves.height(9, 40.5 + d), 2.5 * std::sin(std::numbers::pi * (2.25 + d) / 4.5), 1e-12);
  }
  EXPECT_EQ(ridges.height(9, 45), 0);
  EXPECT_NEAR(waves.height(9, 45), -2.5, 1e-12);
  EXPECT_EQ(waves.min_height(), -2.5);
  EXPECT_EQ(bumps.min_height(), 0);
}

TEST(Plate, BlobsAreHemispheresOnAGrid) {
  const Plate plate = Plate::named("4_Blob");
  EXPECT_NEAR(plate.height(4.5 + 9 + 1.5, 40.5 + 18 - 2), 0, 1e-12);  // 1.5^2 + 2^2 = 2.5^2: on the rim
  EXPECT_NEAR(plate.height(4.5 + 27 + 1, 40.5 + 1), std::sqrt(6.25 - 2), 1e-12);
  EXPECT_EQ(plate.height(9, 45), 0);
  EXPECT_FALSE(plate.uniform_in_x());
  EXPECT_TRUE(Plate::named("6_Bumps").uniform_in_x());
}

TEST(Plate, GenericNamesSetPitchAndHeight) {
  EXPECT_EQ(Plate::named("bumps4").max_height(), 2);  // a higher bump would run into its neighbour
  EXPECT_EQ(Plate::named("ridges6h1.5").max_height(), 1.5);

  EXPECT_EQ(Plate::named("plain").height(18, 54), 0);
  EXPECT_EQ(Plate::named("plain").max_height(), 0);
}

TEST(Plate, MixedPlatesShareTheLength) {
  const Plate plate = Plate::named("bumps12h1+plain+waves9h2");
  EXPECT_NEAR(plate.height(3, 42), 1, 1e-12);  // one bump in [36, 48]
  EXPECT_EQ(plate.height(3, 54), 0);
  EXPECT_EQ(plate.max_height(), 2);
  EXPECT_EQ(plate.min_height(), -2);
  EXPECT_LT(plate.texture_begin(), 42);
  EXPECT_GT(plate.texture_end(), 66);
}

TEST(Plate, RefusesNamesItCannotRead) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "unknown texture \"\""},
      {"7_Bumps", "unknown texture \"7_Bumps\""},
      {"bumps", "no pitch at \"\""},
      {"bumpsx", "no pitch at \"x\""},
      {"bumps0", "pitch and height must be positive"},
      {"bumps-3", "pitch and height must be positive"},
      {"ridges6h", "no height at \"\""},
      {"ridges6h1.5z", "cannot read \"z\""},
      {"+", "unknown texture \"\""},
      {"bumps6h4", "bumps are twice as wide as high and overlap at this pitch"},
      {"ridges6+", "unknown texture \"\""},
      {"bumps1e400", "cannot read \"e400\""},
      {"waves90", "no element fits between its ends"},
      {"ridgesnan", "pitch and height must be positive"},
      {"../plain", "unknown texture \"../plain\""}};
  for (const auto& [bad, why] : cases) {
    EXPECT_REFUSAL(
        "plate \"" + std::string(bad) + "\": " + why +
            "; expected a rig plate such as 3_Bumps, or plain, or ridges|bumps|waves|blobs with a pitch "
            "in mm such as bumps12 or ridges6h1.5, several joined by +, or random and a number, or an STL "
            "file",
        Plate::named(bad));
  }
}

void write_plate(const std::string& path, const std::string& name) {
  write_file(path, stl_bytes(mesh_of(Plate::named(name)), name));
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

TEST(PlateFile, IsKeptBesideTheRecordingsAndNothingElseIsRead) {
  const TemporaryFolder folder;
  make_directories(folder / "out");
  write_plate(folder / "my.stl", "6_Bumps");
  for (const std::string& name : {std::string("6_Bumps"), folder / "my.stl", folder / "my.stl"})
    keep_plate_file(name, folder / "out");
  EXPECT_EQ(plate_in_folder("my.stl", folder / "out").crests().size(), 6u);
  EXPECT_EQ(plate_in_folder("3_Bumps", folder / "out").name(), "3_Bumps");
  for (const std::string& elsewhere : {"../" + folder.path() + "/my.stl", folder / "my.stl"})
    EXPECT_REFUSAL(
        "plate '" + elsewhere + "': expected the name of an STL file beside the recordings, found a path",
        plate_in_folder(elsewhere, folder.path()));
  write_plate(folder / "my.stl", "3_Bumps");
  EXPECT_EQ(what_of<FileError>([&] { keep_plate_file(folder / "my.stl", folder / "out"); }),
            folder / "out/my.stl" + ": is another plate than " + folder / "my.stl" +
                "; rename one of them or choose another folder");
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
    double squares = 0;  // the foot of a blob is upright: single pixels there may differ by 0.1
    for (std::size_t k = 0; k < truth.size(); ++k) squares += std::pow(double{truth[k] - expected[k]}, 2);
    EXPECT_LT(std::sqrt(squares / 256), 0.02) << i;
  }
  const std::string before = set.fingerprint();
  write_plate(folder / "my.stl", "6_Blob");  // another plate of the same name is other data
  EXPECT_NE(WindowSet::load(folder.path(), {}, {.timesteps = 32}).fingerprint(), before);
}

TEST(RandomPlate, IsWhatItsNumberSays) {
  EXPECT_EQ(Plate::named("random4000000000").height(18, 50), random_plate(4'000'000'000U).height(18, 50));
  EXPECT_EQ(random_plate(7).name(), "random7");
  for (const char* name : {"random", "random-1", "random4294967296"})
    EXPECT_THROW(Plate::named(name), std::invalid_argument) << name;
}

// A seed's plates are the same for ever: trainings are repeated from it.
TEST(RandomPlate, PinnedBits) {
  Hash hash;
  for (std::uint32_t number = 0; number < 64; ++number) {
    const Plate plate = random_plate(number);
    for (double y = 0; y < 108; y += 0.9)
      for (double x = 0; x < 36; x += 2.1) hash.add(static_cast<float>(plate.height(x, y)));
  }
  EXPECT_EQ(hash.hex(), "30417ebc997890c2");
}

// What the surface says of itself must be what its heights say.
void expect_heights_as_stated(const Plate& plate) {
  double highest = 0;
  for (double y = 0; y <= rig::kPlateLengthMm; y += 0.25)
    for (double x = 0; x <= rig::kPlateWidthMm; x += 0.5) {
      const double z = plate.height(x, y);
      highest = std::max(highest, z);
      ASSERT_TRUE(z == 0 || (y >= plate.texture_begin() - 1e-9 && y <= plate.texture_end() + 1e-9));
      ASSERT_TRUE(!plate.uniform_in_x() || z == plate.height(0, y)) << plate.name();
    }
  EXPECT_LE(highest, plate.max_height() + 1e-12) << plate.name();
  EXPECT_GE(highest, 0.8 * plate.max_height()) << plate.name();
}

TEST(RandomPlate, HasEveryKindOfTextureWithinItsBounds) {
  std::map<std::string, int> kinds;
  int plain = 0, oblique_or_scattered = 0, two = 0;
  for (std::uint32_t number = 0; number < 400; ++number) {
    const Plate plate = random_plate(number);
    EXPECT_GE(plate.min_height(), -3) << number;
    EXPECT_LE(plate.max_height(), 3) << number;
    EXPECT_GE(plate.texture_begin(), 0) << number;
    EXPECT_LE(plate.texture_end(), rig::kPlateLengthMm) << number;
    if (number < 60) expect_heights_as_stated(plate);
    EXPECT_EQ(plate.height(18, 2), 0) << number;  // the onset is on the flat plate
    plain += plate.max_height() == 0 ? 1 : 0;
    two += plate.textures().size() == 2 ? 1 : 0;
    oblique_or_scattered += plate.textures().empty() && !plate.uniform_in_x() ? 1 : 0;
    for (const Texture& t : plate.textures()) {
      ++kinds[t.kind];
      EXPECT_GE(t.pitch_mm, 4);
      EXPECT_LE(t.pitch_mm, 15);
    }
  }
  EXPECT_EQ(kinds.size(), 4U);
  for (const auto& [kind, count] : kinds) EXPECT_GT(count, 20) << kind;
  EXPECT_NEAR(plain, 47, 15);
  EXPECT_GT(two, 15);
  EXPECT_GT(oblique_or_scattered, 40);
}

TEST(RandomPlate, ResemblanceIsKindAndPitch) {
  const auto resembles = [](const char* a, const char* b) {
    return resemble(Plate::named(a), Plate::named(b));
  };
  EXPECT_TRUE(resembles("3_Bumps", "bumps12"));
  EXPECT_TRUE(resembles("bumps11.6h1", "3_Bumps"));
  EXPECT_TRUE(resembles("ridges4+bumps12", "3_Bumps"));
  EXPECT_FALSE(resembles("bumps11.4", "3_Bumps"));
  EXPECT_FALSE(resembles("ridges12", "3_Bumps"));
  EXPECT_FALSE(resembles("plain", "3_Bumps"));
}

}  // namespace supertac::plate_test
