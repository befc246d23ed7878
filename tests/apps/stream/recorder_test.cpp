// Recordings at somebody's wish.
#include "apps/stream/recorder.h"

#include "tests/support/test.h"

namespace supertac::recorder_test {

namespace fs = std::filesystem;

class InFolder : public testing::Test {
 protected:
  InFolder() : before_(fs::current_path()) { fs::current_path(folder_.path()); }
  ~InFolder() override { fs::current_path(before_); }

  TemporaryFolder folder_;
  fs::path before_;
};

using RecorderTest = InFolder;

const PictureFormat kFormat{.signals = 2, .image = {2, 2, 1}, .half_widths = true, .distance = true};

LiveFrame seen_at(double time_s) {
  static const std::vector<float> volts = {1, 2}, picture = {3, 4, 5, 6}, half = {7, 8, 9, 10};
  return {.time_s = time_s, .signals = volts, .picture = picture, .half_widths = half, .distance = 11.0};
}

TEST_F(RecorderTest, KeepsWhatCameBetweenStartAndStop) {
  std::string name;
  {
    Recorder recorder(kFormat, {{"kind", "pictures"}});
    recorder.add(seen_at(0));
    EXPECT_EQ(recorder.stop(), "nothing is being recorded");
    EXPECT_TRUE(recorder.start().starts_with("recording recording_2"));
    name = recorder.status().recording;
    recorder.add(seen_at(1));
    recorder.add(seen_at(1.5));
    EXPECT_EQ(recorder.status().seconds, 0.5);
    EXPECT_FALSE(fs::exists(name));  // not before it is complete
    EXPECT_EQ(recorder.stop(), "writing " + name);
    recorder.add(seen_at(2));
    EXPECT_EQ(recorder.stop(), "nothing is being recorded");
    EXPECT_EQ(recorder.finish(), "recorded " + name);
  }
  const SafetensorsFile file = SafetensorsFile::read(name);
  EXPECT_EQ(file.f64("time_s"), (std::vector<double>{1, 1.5}));
  EXPECT_EQ(file.f32("volts"), (std::vector<float>{1, 2, 1, 2}));
  EXPECT_EQ(file.f32("half_widths"), (std::vector<float>{7, 8, 9, 10, 7, 8, 9, 10}));
  EXPECT_EQ(file.f32("distances"), (std::vector<float>{11, 11}));
}

TEST_F(RecorderTest, AnEndCompletesTheFile) {
  std::string name;
  {
    Recorder recorder(kFormat, {});
    recorder.start();
    name = recorder.status().recording;
    recorder.add(seen_at(1));
  }
  EXPECT_EQ(SafetensorsFile::read(name).f64("time_s").size(), 1U);
}

TEST_F(RecorderTest, WithoutAFrameThereIsNoFile) {
  Recorder recorder(kFormat, {});
  recorder.start();
  const std::string name = recorder.status().recording;
  EXPECT_EQ(recorder.finish(), "no frame came: nothing was recorded");
  EXPECT_FALSE(fs::exists(name));
}

TEST_F(RecorderTest, AFileThatAppearedMeanwhileStays) {
  std::string name;
  {
    Recorder recorder(kFormat, {});
    recorder.start();
    name = recorder.status().recording;
    recorder.add(seen_at(1));
    write_file(name, "mine");
    const std::string said = recorder.finish();
    EXPECT_NE(said.find("-2.safetensors"), std::string::npos) << said;
  }
  EXPECT_EQ(read_text_file(name, 9), "mine");
  name.replace(name.find(".safe"), 0, "-2");
  EXPECT_EQ(SafetensorsFile::read(name).f64("time_s").size(), 1U);
}

TEST_F(RecorderTest, AFolderThatIsGoneIsSaid) {
  Recorder recorder(kFormat, {});
  fs::remove_all(fs::current_path());
  EXPECT_FALSE(recorder.start().starts_with("recording"));
  EXPECT_EQ(recorder.status().recording, "");
}

}  // namespace supertac::recorder_test
