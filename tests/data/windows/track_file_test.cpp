#include "data/windows/track_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "data/windows/split.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/data/test_recordings.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kNothing = 0, kSome = 20'000, kAll = 1'000'000'000;

// Passes with all that can befall one: a gap, a lifted finger, places unknown, no registration.
class TrackFiles : public testing::Test {
 protected:
  TrackFiles() {
    for (int pass = 1; pass <= 4; ++pass) {
      Recording recording = make_recording({.plate = pass % 2 == 0 ? "ridges6" : "bumps12",
                                            .trial = 1 + pass / 3,
                                            .pass = pass,
                                            .frames = 300});
      for (std::size_t i = 150; pass == 1 && i < 300; ++i) recording.time_s[i] += 1;
      for (std::size_t i = 0; pass == 2 && i < 20; ++i) recording.position_mm[2 * i] = NAN;
      for (std::size_t i = 0; pass == 3 && i < 300; ++i)
        recording.lift_mm.push_back(i < 50 ? 8 : i < 90 ? 1 : 0);
      if (pass == 4) recording.metadata["registration_reliable"] = "no";
      write_recording(folder_ / (std::to_string(pass) + ".safetensors"), recording);
    }
  }
  std::shared_ptr<const TrackFile> open(std::uint64_t memory = kNothing) const {
    return TrackFile::open(folder_.path(), {.rate_hz = settings_.rate_hz, .memory = memory});
  }
  WindowSet from_file(std::uint64_t memory) const {
    WindowSet set(settings_);
    set.add(open(memory));
    return set;
  }
  std::string recording(int pass) const { return folder_ / (std::to_string(pass) + ".safetensors"); }
  fs::path kept(const std::string& ending) const {
    for (const auto& entry : fs::directory_iterator(folder_ / ".supertac"))
      if (entry.path().extension() == ending) return entry.path();
    return {};
  }
  // Another bit in the middle, and the old time.
  static void damage(const fs::path& path) {
    const auto time = fs::last_write_time(path);
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    const auto middle = static_cast<std::streamoff>(fs::file_size(path) / 2);
    file.seekg(middle);
    const int byte = file.get();
    file.seekp(middle);
    file.put(static_cast<char>(byte ^ 1));
    file.close();
    fs::last_write_time(path, time);
  }

  TemporaryFolder folder_;
  WindowSettings settings_ = wide_settings(16);
};

TEST_F(TrackFiles, ReadingIsWatchedAndCanBeEnded) {
  std::vector<std::size_t> seen;
  const auto watch = [&](std::size_t done, std::size_t all) {
    EXPECT_EQ(all, 4u);
    seen.push_back(done);
    if (seen.size() == 3) throw std::runtime_error("enough");
  };
  TrackFileSettings settings{.rate_hz = settings_.rate_hz, .watch = watch};
  EXPECT_THROW((void)TrackFile::open(folder_.path(), settings), std::runtime_error);
  EXPECT_EQ(seen, (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_TRUE(kept(".f32").empty());
  EXPECT_EQ(open()->index().cards.size(), 4u);
  seen.clear();
  EXPECT_THROW((void)WindowSet::load(folder_.path(), {}, settings_, watch), std::runtime_error);
  seen.clear();
  EXPECT_THROW((void)SignalRange::of_folder(folder_.path(), {}, watch), std::runtime_error);
}

TEST_F(TrackFiles, GiveTheSameWindowsWhateverIsHeldInMemory) {
  for (const double rate_hz : {300.0, 110.0}) {
    settings_.rate_hz = rate_hz;
    settings_.stride = rate_hz == 300 ? 1 : 3;
    settings_.scaling.levelled = rate_hz == 300;
    const WindowSet expected = WindowSet::load(folder_.path(), {}, settings_);
    ASSERT_GT(expected.counts().gaps + expected.counts().lifting + expected.counts().unreliable, 2U);
    for (const std::uint64_t memory : {kNothing, kSome, kAll}) {
      const WindowSet set = from_file(memory);
      ASSERT_EQ(set.counts().summary(), expected.counts().summary());
      EXPECT_EQ(set.fingerprint(), expected.fingerprint());
      std::vector<float> a(16 * 16), b(a), picture(set.image().pixels()), truth(picture);
      for (std::size_t i = 0; i < set.size(); ++i) {
        set.window(i, a), expected.window(i, b);
        set.truth(i, picture), expected.truth(i, truth);
        ASSERT_EQ(a, b) << i;
        ASSERT_EQ(picture, truth) << i;
        ASSERT_EQ(set.last_frame(i), expected.last_frame(i)) << i;
        ASSERT_EQ(set.zone(i), expected.zone(i)) << i;
        ASSERT_EQ(set.history(i), expected.history(i)) << i;
      }
      EXPECT_EQ(set.content(folder_.path()), hash_of_recordings(folder_.path(), {}));
    }
  }
}

TEST_F(TrackFiles, FindTheSameLeakage) {
  fs::copy_file(recording(1), recording(5));
  const WindowSet expected = WindowSet::load(folder_.path(), {}, settings_);
  const Split split = make_split(expected, SplitKind::window, 3);
  const Leakage there = find_leakage(expected, split), here = find_leakage(from_file(kSome), split);
  ASSERT_GT(there.duplicated, 0U);
  EXPECT_EQ(here.duplicated, there.duplicated);
  EXPECT_EQ(here.overlapping, there.overlapping);
}

TEST_F(TrackFiles, KnowTheRangeOfTheSignals) {
  EXPECT_EQ(open()->index().range.values(), SignalRange::of_folder(folder_.path(), {}).values());
}

TEST_F(TrackFiles, TakeOnlyTheseNames) {
  const auto file = TrackFile::open(folder_.path(), {.plates = {"ridges6"}});
  EXPECT_EQ(file->index().cards.size(), 2U);
  EXPECT_EQ(file->index().content, hash_of_recordings(folder_.path(), {"ridges6"}));
  EXPECT_THROW(TrackFile::open(folder_.path(), {.plates = {"waves4"}}), std::invalid_argument);
  EXPECT_EQ(TrackFile::open(folder_.path(), {})->index().cards.size(), 4U);
}

TEST_F(TrackFiles, DoNotReadRecordingsAgainThatHaveNotChanged) {
  const std::string before = from_file(kNothing).fingerprint();
  damage(recording(2));  // which only a reader of the whole can see
  EXPECT_EQ(from_file(kNothing).fingerprint(), before);
  fs::last_write_time(recording(2), fs::file_time_type::clock::now());
  EXPECT_THROW(open(), FileError);  // its checksum is wrong
}

TEST_F(TrackFiles, AreMadeAgainWhenRecordingsComeGoOrChange) {
  EXPECT_EQ(open()->index().cards.size(), 4U);
  fs::copy_file(recording(1), recording(5));
  EXPECT_EQ(open()->index().cards.size(), 5U);
  fs::remove(recording(2));
  EXPECT_EQ(open()->index().cards.size(), 4U);
  const std::string before = from_file(kNothing).fingerprint();
  write_recording(recording(3), make_recording({.level = 1.5F}));
  EXPECT_NE(from_file(kNothing).fingerprint(), before);
  EXPECT_EQ(from_file(kNothing).fingerprint(), WindowSet::load(folder_.path(), {}, settings_).fingerprint());
}

TEST_F(TrackFiles, AreMadeAgainWhenTheyAreDamaged) {
  const std::string expected = from_file(kNothing).fingerprint();
  damage(kept(".safetensors"));
  EXPECT_EQ(from_file(kNothing).fingerprint(), expected);
  fs::resize_file(kept(".f32"), 1000);
  EXPECT_EQ(from_file(kNothing).fingerprint(), expected);
  fs::remove_all(folder_ / ".supertac");
  EXPECT_EQ(from_file(kNothing).fingerprint(), expected);
}

TEST_F(TrackFiles, ThatAreShortenedWhileTheyAreReadGiveAnError) {
  const WindowSet set = from_file(kNothing);
  fs::resize_file(kept(".f32"), 1000);
  std::vector<float> window(16 * 16);
  EXPECT_THROW(set.window(set.size() - 1, window), FileError);
}

TEST_F(TrackFiles, RecallWhatWasComputedOfTheseRecordings) {
  int calls = 0;
  const auto compute = [&] { return "text " + std::to_string(++calls); };
  EXPECT_EQ(open()->recall("a", compute), "text 1");
  EXPECT_EQ(open()->recall("a", compute), "text 1");
  EXPECT_EQ(open()->recall("b", compute), "text 2");
  write_recording(recording(3), make_recording({.level = 1.5F}));
  EXPECT_EQ(open()->recall("a", compute), "text 3");
}

TEST_F(TrackFiles, OfOtherArraysAreRefused) {
  Recording other = make_recording({});
  other.array = {.rows = 2, .columns = 8};
  write_recording(recording(9), other);
  EXPECT_THROW(open(), std::runtime_error);
}

}  // namespace
}  // namespace supertac
