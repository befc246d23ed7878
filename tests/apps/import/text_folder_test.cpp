#include "apps/import/text_folder.h"

#include <nlohmann/json.hpp>

#include "tests/data/registration/lossy_pass.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::text_folder_test {

std::vector<ImportedPass> import_all(const std::string& root, const FolderImport& settings) {
  std::vector<ImportedPass> all;
  import_text_folder(root, settings, [&all](std::vector<ImportedPass> plate) {
    std::move(plate.begin(), plate.end(), std::back_inserter(all));
  });
  return all;
}

std::string put(const TemporaryFolder& folder, const std::string& name, const std::string& text) {
  const std::string path = folder.file(name);
  make_directories(std::filesystem::path(path).parent_path().string());
  write_file(path, text);
  return path;
}

TEST(TextFolder, EveryFrameGetsItsPlace) {
  const TemporaryFolder folder;
  std::vector<Recording> truth;
  for (const int pass : {2, 3, 4}) {
    truth.push_back(lossy_pass("6_Ridges", pass, 41));
    put(folder, "6_Ridges/1/" + std::to_string(pass) + ".txt", text_of(truth.back()));
  }
  std::vector<std::pair<std::size_t, std::size_t>> told;
  const auto imported =
      import_all(folder.path(),
                 {.progress = [&](std::size_t done, std::size_t files) { told.emplace_back(done, files); }});
  ASSERT_EQ(imported.size(), 3u);
  ASSERT_GE(told.size(), 2u);  // as many files at a time as there are threads
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.front(), std::pair(std::size_t{0}, std::size_t{3}));
  EXPECT_EQ(told.back(), std::pair(std::size_t{3}, std::size_t{3})) << "then the alignment";

  for (std::size_t i = 0; i < imported.size(); ++i) {
    const Recording& r = imported[i].recording;
    EXPECT_TRUE(imported[i].registration.reliable) << imported[i].registration.reason;
    EXPECT_GT(imported[i].registration.agreement, 0.8);
    EXPECT_EQ(r.plate, "6_Ridges");
    EXPECT_EQ(r.trial, 1);
    EXPECT_EQ(r.pass, static_cast<int>(i) + 2);
    EXPECT_EQ(r.metadata.at("time_base"), "registered");
    ASSERT_EQ(r.frames(), truth[i].frames());
    for (std::size_t f = 0; f < r.frames(); ++f) {
      const float y = truth[i].position_mm[2 * f + 1];
      if (y > 28 && y < 80) {
        ASSERT_NEAR(r.position_mm[2 * f + 1], y, 1) << i << ' ' << f;
      }
    }
  }
}

TEST(TextFolder, APlateOfYourOwnLiesBesideItsFolder) {
  const TemporaryFolder folder;
  put(folder, "my/3/7.txt", text_of(full_pass("plain", 1, 1)));
  put(folder, "my/3/notes.md", "not looked at");
  put(folder, ".hidden/1/1.txt", "not looked at");
  put(folder, "my.stl", "solid nothing\nendsolid");
  EXPECT_EQ(what_of<FileError>([&] { import_all(folder.path(), {}); }),
            folder / "my.stl" + ": holds no triangle; export the model again")
      << "a plate without a triangle";
  std::filesystem::remove(folder.file("my.stl"));
  std::filesystem::rename(folder.file("my"), folder.file("plain"));
  const auto imported = import_all(folder.path(), {.speed_mm_s = 7});
  ASSERT_EQ(imported.size(), 1u);
  EXPECT_EQ(recording_file_name(imported[0].recording), "plain_t3_p7_v7.safetensors");
  EXPECT_EQ(imported[0].plate_file, "");
  EXPECT_EQ(imported[0].registration.reason, "a plain plate has nothing to register against");
}

// A published folder: remarks beside the passes, a plate in other letters, one that nobody knows.
TEST(TextFolder, WhatIsNoPassIsNamedAndLeftOutWhenAskedTo) {
  const std::string number = "expected a number from 1 as its name: TEXT_DIR/<plate>/<trial>/<pass>.txt",
                    text = text_of(full_pass("plain", 2, 1));
  const std::tuple<std::string, std::string, std::string> cases[] = {
      {"plain/1/1.txt", "plain/1/1.txt",
       "holds no line of numbers (too few lines); expected a row a line, separated by commas, tabs or "
       "blanks"},
      {"plain/1/InitTime.txt", "plain/1/InitTime.txt", number},
      {"plain/1/2.txt", "plain/1/2.txt", "is the same trial and pass as"},
      {"plain/notes/1.txt", "plain/notes", number},
      {"plain/0/1.txt", "plain/0", number},
      {"Plain/1/1.txt", "Plain", "unknown plate: plate \"Plain\": unknown texture"}};
  for (const auto& [file, named, message] : cases) {
    const TemporaryFolder folder;
    put(folder, "plain/1/02.txt", text);
    put(folder, file, "start? ENTER\n");
    const std::string refusal = folder.file(named) + ": " + message;
    EXPECT_ERROR(import_all(folder.path(), {}), FileError, refusal);
    std::vector<std::string> left_out;
    const FolderImport lenient{.left_out = [&](const FileError& e) { left_out.push_back(e.what()); }};
    EXPECT_EQ(import_all(folder.path(), lenient).size(), 1u) << file;
    ASSERT_EQ(left_out.size(), 1u) << file;
    EXPECT_TRUE(left_out[0].starts_with(refusal)) << left_out[0];
  }
  const TemporaryFolder folder;
  put(folder, "plain/1/1.csv", text);
  EXPECT_ERROR(import_all(folder.path(), {}), FileError,
               "holds no <plate>/<trial>/<pass>.txt; name the folder");
  put(folder, "plain/1/1.txt", "no numbers at all\n");
  EXPECT_ERROR(import_all(folder.path(), {.left_out = [](const FileError&) {}}), FileError,
               "none of 1 files is a recording");
  EXPECT_EQ(what_of<FileError>([&] { import_all("/nowhere", {}); }),
            "/nowhere: cannot list the folder: No such file or directory; check the name");
}

TEST(TextFolder, TheSummaryTellsWhatBecameOfAPass) {
  ImportedPass pass{.path = "x", .plate = Plate::named("3_Bumps"), .plate_file = {}};
  pass.recording.trial = 2;
  pass.recording.pass = 4;
  pass.lines = 100, pass.dropped = 3;
  pass.registration.residual = 0.375;
  pass.registration.reason = "no taxel felt anything";
  const std::string start = "3_Bumps/2/4.txt  100 lines, 3 dropped, residual 0.38 mm, ";
  EXPECT_EQ(pass.summary(), start + "not reliable: no taxel felt anything");
  pass.registration.reliable = true;
  pass.registration.agreement = 0.9;
  pass.registration.shift_mm = -0.25;
  pass.registration.lost_s = 0.4;
  EXPECT_EQ(pass.summary(), start + "aligned by -0.25 mm, another 0.40 s lost, reliable");
  EXPECT_EQ(pass.to_json()["registration"]["lost_s"], 0.4);
  EXPECT_EQ(pass.to_json()["dropped"], 3);
}

}  // namespace supertac::text_folder_test
