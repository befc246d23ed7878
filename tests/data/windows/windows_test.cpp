#include "data/windows/windows.h"

#include "data/plates/truth.h"
#include "data/scores/baselines.h"
#include "data/simulation/simulator.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::windows_test {

TEST(Windows, AreTheLastFramesOfAPass) {
  WindowSet set(wide_settings(16));
  const Recording recording = make_recording({});
  set.add(recording);
  ASSERT_EQ(set.size(), 85U);  // 100 frames, the first window ends at frame 15
  std::vector<float> window(16 * 16);
  set.window(3, window);
  EXPECT_EQ(set.frame_of(3), 18U);
  for (std::size_t i = 0; i < window.size(); ++i)
    ASSERT_EQ(window[i], set.settings().scaling(recording.signals[3 * rig::kTaxels + i]));
  EXPECT_EQ(set.shown_frame(3), std::vector<float>(window.end() - rig::kTaxels, window.end()));
  EXPECT_NEAR(set.position(3).y_mm, 30 + 18 * 10.0 / 300, 1e-4);
  EXPECT_EQ(set.position(3).x_mm, 18);
}

TEST(Windows, ShowWhereTheFingerWasTheirDelayAgo) {
  constexpr std::size_t kFrames = 5;
  WindowSettings settings = wide_settings(16);
  WindowSet now(settings);
  settings.delay_s = kFrames / 300.0;
  WindowSet later(settings);
  Recording measured = make_recording({.pass = 2});
  measured.truth_height = measured.truth_width = 16;
  for (std::size_t i = 0; i < 100 * 256; ++i) measured.truth.push_back(static_cast<float>(i / 256) / 100);
  for (WindowSet* set : {&now, &later}) set->add(make_recording({})), set->add(measured);
  ASSERT_EQ(later.size(), now.size());
  std::vector<float> a(256), b(256);
  for (std::size_t i = kFrames; i < now.size(); ++i) {
    if (i >= 85 && i < 85 + kFrames) continue;  // of the pass before
    EXPECT_EQ(later.raw_window(i), now.raw_window(i));
    EXPECT_EQ(later.position(i).y_mm, now.position(i - kFrames).y_mm);
    EXPECT_EQ(later.shown_frame(i), now.shown_frame(i - kFrames));
    now.truth(i - kFrames, a), later.truth(i, b);
    ASSERT_EQ(a, b) << i;
  }
  EXPECT_NE(later.fingerprint(), now.fingerprint());
  const std::uint32_t shown[] = {10, 20}, shown_later[] = {10 + kFrames, 20 + kFrames};
  upsampled_frame(now, shown).predict(now.raw_window(30), a);
  upsampled_frame(later, shown_later).predict(later.raw_window(30 + kFrames), b);
  EXPECT_EQ(a, b) << "bicubic interpolation of the frame that is shown";
}

TEST(Windows, NeverCrossTheEdgeOfAPass) {
  WindowSet set(wide_settings(16));
  set.add(make_recording({.frames = 40, .level = 2.0F}));
  set.add(make_recording({.pass = 2, .frames = 40, .level = 1.2F}));
  ASSERT_EQ(set.size(), 50U);
  for (std::size_t i = 0; i < set.size(); ++i) {
    const auto window = set.raw_window(i);
    const bool first = set.pass_of(i) == 0;
    for (const float v : window)
      ASSERT_EQ(v < 0.7F, first) << i;  // (3 - 2) / 2 = 0.5 against (3 - 1.2) / 2 = 0.9
  }
  EXPECT_EQ(set.passes()[1].first_window, 25U);
  EXPECT_EQ(set.passes()[1].windows, 25U);
}

TEST(Windows, NeverCrossAGap) {
  Recording recording = make_recording({});
  for (std::size_t i = 50; i < 100; ++i) recording.time_s[i] += 1;
  WindowSet set(wide_settings(16));
  set.add(recording);
  EXPECT_EQ(set.size(), 70U);
  EXPECT_EQ(set.counts().gaps, 1U);
  EXPECT_EQ(set.counts().too_early, 30U);
  for (std::size_t i = 0; i < set.size(); ++i) {
    EXPECT_TRUE(set.frame_of(i) < 50 || set.frame_of(i) >= 65);
    EXPECT_EQ(set.history(i), set.frame_of(i) < 50 ? set.frame_of(i) + 1 : set.frame_of(i) - 49);
  }
}

TEST(Windows, OfWhichXOrYIsUnknownHaveNoTruth) {
  for (const std::size_t unknown : {0U, 1U}) {
    Recording recording = make_recording({});
    for (std::size_t i = 90; i < 100; ++i) recording.position_mm[2 * i + unknown] = NAN;
    WindowSet set(wide_settings(16));
    set.add(recording);
    EXPECT_EQ(set.counts().no_position, 10U) << unknown;
  }
}

TEST(Windows, CountEveryFrameOnce) {
  WindowSettings settings = wide_settings(16);
  settings.stride = 3;
  WindowSet set(settings);
  Recording lifting = make_recording({});
  lifting.metadata["registration_reliable"] = "yes";
  lifting.lift_mm.assign(100, 0);
  for (std::size_t i = 61; i < 100; ++i) lifting.lift_mm[i] = 1;
  set.add(lifting);
  Recording unplaced = make_recording({.pass = 2});
  unplaced.position_mm.clear();
  set.add(unplaced);
  Recording unreliable = make_recording({.pass = 3});
  unreliable.metadata["registration_reliable"] = "no";
  set.add(unreliable);
  const WindowCounts& counts = set.counts();
  EXPECT_EQ(counts.recordings, 3U);
  EXPECT_EQ(counts.frames, 300U);
  EXPECT_EQ(counts.unreliable + counts.no_position + counts.lifting + counts.too_early + counts.off_stride +
                counts.windows,
            counts.frames);
  EXPECT_EQ(counts.no_position, 100U);
  EXPECT_EQ(counts.unreliable, 100U);
  EXPECT_EQ(counts.lifting, 39U);
  EXPECT_EQ(counts.too_early, 15U);
  EXPECT_EQ(counts.windows, 16U);  // frames 15, 18, ..., 60
  EXPECT_EQ(set.size(), 16U);
  EXPECT_EQ(set.frame_of(0), 15U);
  EXPECT_EQ(set.frame_of(1), 18U);
  EXPECT_NE(counts.summary().find("100 without position"), std::string::npos);
  EXPECT_EQ(counts.summary().find("gaps"), std::string::npos);
  set.add(make_recording({.pass = 4}), ".",
          {.training_only = true, .augmentable = false});  // as training adds
  EXPECT_NE(counts.summary().find("400 samples of 3 recordings and 1 simulated passes"), std::string::npos);
}

TEST(Windows, InTheAirTheTruthIsFlat) {
  Recording recording = make_recording({.plate = "3_Bumps"});
  for (std::size_t i = 0; i < 100; ++i) recording.position_mm[2 * i + 1] = 54;
  recording.lift_mm.assign(100, 0);
  for (std::size_t i = 50; i < 100; ++i)
    recording.lift_mm[i] = i < 60 ? 3.9F : 4.1F;  // clear at 2.5 + 1.5 mm
  WindowSet set(wide_settings(16));
  set.add(recording);
  ASSERT_EQ(set.size(), 75U);
  EXPECT_EQ(set.counts().lifting, 10U);
  std::vector<float> truth(256);
  set.truth(0, truth);
  EXPECT_EQ(set.zone(0), Zone::contact);
  EXPECT_TRUE(in_contact(truth));
  set.truth(74, truth);
  EXPECT_EQ(set.zone(74), Zone::air);
  EXPECT_FALSE(in_contact(truth));
}

TEST(Windows, OfAnyArray) {
  SimulatorSettings settings;
  settings.array = {.rows = 6, .columns = 6, .pitch_mm = 2};
  const Recording recording = simulate_pass(Plate::named("4_Blob"), {.pass = 4}, settings);
  WindowSet set(WindowSettings{.timesteps = 32});
  set.add(recording);
  EXPECT_EQ(set.array(), settings.array);
  EXPECT_EQ(set.image(), (ImageGrid{24, 24, 0.5}));
  EXPECT_EQ(set.raw_window(0).size(), 32U * 36);
  EXPECT_EQ(set.shown_frame(5).size(), 36U);
  std::vector<float> truth(576), expected(576);
  set.truth(800, truth);
  truth_image(Plate::named("4_Blob"), set.position(800).x_mm, set.position(800).y_mm, {24, 24, 0.5},
              expected);
  EXPECT_EQ(truth, expected);
}

TEST(Windows, RefuseRecordingsOfAnotherArray) {
  WindowSettings settings = wide_settings(16);
  settings.array = TaxelArray{.rows = 6, .columns = 6, .pitch_mm = 2};
  WindowSet for_model(settings);
  EXPECT_EQ(
      what_of<std::runtime_error>([&] { for_model.add(make_recording({})); }),
      "was recorded with 4x4 taxels at 3 mm, expected 6x6 taxels at 2 mm; give recordings of the array the "
      "model is for, and no others");
  WindowSet mixed(wide_settings(16));
  Recording other = make_recording({});
  other.array.pitch_mm = 2.5;
  mixed.add(other);
  EXPECT_ERROR(mixed.add(make_recording({})), std::runtime_error, "expected 4x4 taxels at 2.5 mm");
}

TEST(Windows, TruthIsTheTruthImageOfTheLastFrame) {
  for (const char* plate : {"bumps12", "ridges6", "4_Blob", "6_Waves", "plain"}) {
    for (const int scale : {2, 4, 8}) {
      WindowSettings settings = wide_settings(16);
      settings.scale = scale;
      WindowSet set(settings);
      set.add(make_recording({.plate = plate, .start_y_mm = 45}));
      const auto pixels = static_cast<std::size_t>(16 * scale * scale);
      std::vector<float> truth(pixels), expected(pixels);
      for (std::size_t i = 0; i < set.size(); i += 7) {
        set.truth(i, truth);
        truth_image(Plate::named(plate), set.position(i).x_mm, set.position(i).y_mm,
                    TaxelArray{}.picture(scale), expected);
        ASSERT_EQ(truth, expected) << plate << " " << scale << " " << i;
        ASSERT_EQ(set.contact(i), *std::max_element(truth.begin(), truth.end()) > 0);
      }
    }
  }
}

TEST(Windows, RefuseSettingsOutOfRange) {
  const std::pair<WindowSettings, const char*> cases[] = {
      {{.scale = 3}, "scale expects 2, 4, 8 or 16, got 3"},
      {{.timesteps = 0}, "timesteps expects 1 or more, got 0"},
      {{.stride = 0}, "stride expects 1 or more, got 0"},
      {{.timesteps = 60, .delay_s = 0.2}, "delay_s expects 0 to less than the window lasts, got 0.2"},
      {{.rate_hz = 0}, "rate_hz expects more than 0, got 0"}};
  for (const auto& [settings, refusal] : cases)
    EXPECT_REFUSAL(std::string("windows: ") + refusal, WindowSet{settings});
}

TEST(Windows, RefuseOutputsOfAnotherSizeAndUnknownPlates) {
  WindowSet set(wide_settings(16));
  set.add(make_recording({}));
  std::vector<float> small(255);
  EXPECT_REFUSAL("windows: window expects 256 values, got 255", set.window(0, small));
  EXPECT_REFUSAL("windows: truth expects 256 values, got 255", set.truth(0, small));
  EXPECT_ERROR(set.add(make_recording({.plate = "carpet"})), std::invalid_argument,
               "plate \"carpet\": unknown texture \"carpet\"; expected a rig plate");
  EXPECT_REFUSAL(
      "these signals have no truth to train on or score. Learn from simulated presses "
      "(supertac-simulate --sensor FILE --presses N), film what presses (supertac-import --truth), or slide "
      "over a plate that is known (supertac-import --plate NAME)",
      set.add(make_recording({.plate = "unknown_felt"})));
  EXPECT_EQ(set.size(), 85U);
}

TEST(Windows, FingerprintTellsDataApart) {
  WindowSet a(wide_settings(16)), b(wide_settings(16)), c(wide_settings(16)), d(wide_settings(32));
  a.add(make_recording({}));
  b.add(make_recording({}));
  c.add(make_recording({.level = 2.0001F}));
  d.add(make_recording({}));
  EXPECT_EQ(a.fingerprint(), b.fingerprint());
  EXPECT_NE(a.fingerprint(), c.fingerprint());
  EXPECT_NE(a.fingerprint(), d.fingerprint());
  EXPECT_EQ(a.fingerprint().size(), 16U);
}

// What a finer sensor saw: frame i is i / 1000 in its first pixel, 0.5 in its last quarter, 0 elsewhere.
Recording with_truth(std::size_t frames, const TaxelArray& array) {
  Recording recording = make_recording({.plate = "a sponge", .frames = frames});
  recording.array = array;
  recording.signals.resize(frames * array.signals());
  recording.position_mm.clear();
  recording.truth_height = 4 * array.rows, recording.truth_width = 4 * array.columns;
  const std::size_t pixels = array.picture(4).pixels();
  recording.truth.assign(frames * pixels, 0);
  for (std::size_t i = 0; i < frames; ++i) {
    const auto frame = recording.truth.begin() + static_cast<std::ptrdiff_t>(i * pixels);
    std::fill_n(frame + static_cast<std::ptrdiff_t>(pixels - pixels / 4), pixels / 4, 0.5F);
    *frame = static_cast<float>(i) / 1000;
  }
  return recording;
}

TEST(Windows, HaveTheTruthThatWasMeasured) {
  const TaxelArray array{.rows = 2, .columns = 3};
  for (const double rate_hz : {300.0, 150.0}) {
    WindowSettings settings = wide_settings(16);
    settings.rate_hz = rate_hz;
    WindowSet set(settings);
    set.add(with_truth(100, array));
    ASSERT_EQ(set.size(), rate_hz == 300 ? 85U : 35U);
    std::vector<float> truth(8 * 12);
    for (std::size_t i = 0; i < set.size(); ++i) {
      set.truth(i, truth);
      const double recorded = static_cast<double>(set.frame_of(i)) * 300 / rate_hz;
      ASSERT_EQ(truth[0], static_cast<float>(recorded) / 1000) << i;
      ASSERT_EQ(truth[95], 0.5F);
      ASSERT_EQ(set.zone(i), Zone::contact);
    }
  }
  WindowSet set(wide_settings(16)), other(wide_settings(16));
  set.add(with_truth(100, array));
  Recording changed = with_truth(100, array);
  changed.truth[50 * 96] = 0.9F;
  other.add(changed);
  EXPECT_NE(set.fingerprint(), other.fingerprint());
  Recording coarse = with_truth(100, array);
  coarse.truth_height = 4, coarse.truth_width = 6, coarse.truth.resize(100 * 24UL);
  EXPECT_EQ(what_of<std::runtime_error>([&] { set.add(coarse); }),
            "has a truth of 4x6 pixels, expected 8x12 for 2x3 taxels at 3 mm at scale 4");
}

TEST(Windows, OfOneFrameAreTheRecordedFrames) {
  WindowSet set(WindowSettings{.timesteps = 1});
  Recording recording = with_truth(100, {.rows = 2, .columns = 3});
  for (std::size_t i = 0; i < 100; ++i) recording.time_s[i] = static_cast<double>(i * i);
  set.add(recording);
  ASSERT_EQ(set.size(), 100U);
  std::vector<float> truth(96);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(set.raw_window(i)[0], set.settings().scaling(recording.signals[6 * i]));
    set.truth(i, truth);
    EXPECT_EQ(truth[0], recording.truth[96 * i]);
  }
}

class WindowFiles : public ::testing::Test {
 protected:
  void write(const PassPlan& plan, const std::string& name) const {
    write_recording(folder_ / (name + ".safetensors"), make_recording(plan));
  }
  TemporaryFolder folder_;
  const std::string& dir_ = folder_.path();
};

TEST_F(WindowFiles, LoadInTheOrderOfNames) {
  write({.plate = "ridges6"}, "ridges6_t1_p1_v10");
  write({.plate = "bumps12", .pass = 2}, "bumps12_t1_p2_v10");
  write({.plate = "bumps12"}, "bumps12_t1_p1_v10");
  const WindowSet set = WindowSet::load(dir_, {}, wide_settings(16));
  ASSERT_EQ(set.passes().size(), 3U);
  EXPECT_EQ(set.passes()[0].plate, "bumps12");
  EXPECT_EQ(set.passes()[1].pass, 2);
  EXPECT_EQ(set.passes()[2].plate, "ridges6");
  EXPECT_EQ(set.size(), 3U * 85U);
  EXPECT_EQ(WindowSet::load(dir_, {"ridges6"}, wide_settings(16)).size(), 85U);
}

TEST_F(WindowFiles, SayWhatHelpsWhenThereIsNoWindow) {
  const std::pair<void (*)(Recording&), const char*> cases[] = {
      {[](Recording&) {}, "100 too close to the start of a pass or to a gap; try fewer timesteps"},
      {[](Recording& r) { r.position_mm.clear(); }, "truth needs positions"},
      {[](Recording& r) { r.metadata["registration_reliable"] = "no"; }, "import the passes again"}};
  for (const auto& [change, advice] : cases) {
    Recording recording = make_recording({});
    change(recording);
    write_recording(folder_ / "a.safetensors", recording);
    EXPECT_ERROR(WindowSet::load(dir_, {}, wide_settings(128)), std::runtime_error, advice);
  }
}

TEST_F(WindowFiles, SayWhatIsMissing) {
  EXPECT_EQ(
      what_of<std::runtime_error>([&] { WindowSet::load(dir_, {}, wide_settings(16)); }),
      dir_ + ": has no recordings (*.safetensors); make some with supertac-simulate or supertac-import");
  write({}, "bumps12_t1_p1_v10");
  EXPECT_REFUSAL("windows: plate 'ridges6' has no recording in " + dir_ + "; it has those of bumps12",
                 WindowSet::load(dir_, {"ridges6"}, wide_settings(16)));
}

}  // namespace supertac::windows_test
