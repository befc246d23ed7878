#include "data/registration/registration.h"

#include "tests/data/registration/lossy_pass.h"
#include "tests/support/test.h"

namespace supertac::pass_features_test {

// Triangular dips of half-width 0.2 s on taxel 6, everything else at rest.
Recording dips(const std::vector<double>& centres, double depth, double floor = 0) {
  Recording recording;
  for (int i = 0; i < 3000; ++i) {
    const double t = i / 500.0;
    recording.time_s.push_back(t);
    for (int k = 0; k < rig::kTaxels; ++k) {
      double v = 2.44;
      for (const double c : centres)
        if (k == 6) v -= depth * std::max(0.0, 1 - std::abs(t - c) / 0.2);
      recording.signals.push_back(static_cast<float>(std::max(v, floor)));
    }
  }
  return recording;
}

TEST(Contacts, FindsTimeAndDepth) {
  const auto found = find_contacts(dips({1.5, 3.0}, 0.1));
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].taxel, 6);
  EXPECT_NEAR(found[0].time_s, 1.5, 0.003);
  EXPECT_NEAR(found[1].time_s, 3.0, 0.003);
  EXPECT_NEAR(found[0].depth_v, 0.1, 0.004);
}

TEST(Contacts, SaturationDoesNotMoveTheMiddle) {
  const auto found = find_contacts(dips({2.0}, 0.6, 2.2));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].time_s, 2.0, 0.003);
}

TEST(Contacts, IgnoresNoiseAndFlatSignals) {
  EXPECT_TRUE(find_contacts(dips({}, 0)).empty());
  EXPECT_TRUE(find_contacts(dips({2.0}, 0.005)).empty());
  EXPECT_TRUE(find_contacts(Recording{}).empty());
}

TEST(Contacts, RefusesAnEndlessRecording) {
  Recording recording = dips({1.5}, 0.1);
  recording.time_s.back() = 1e9;
  EXPECT_REFUSAL("find_contacts: time_s expects a span of more than 0 and at most 10000 s, got 1e+09 s",
                 find_contacts(recording));
}

// How far the best straight line y(time_s) is from the true positions between y = 28 and 80: what an uneven
// clock costs any registration (mm, the worst).
double unevenness(const Recording& r) {
  double n = 0, t = 0, y = 0, tt = 0, ty = 0;
  const auto inside = [&](std::size_t i) {
    return r.position_mm[2 * i + 1] >= 28 && r.position_mm[2 * i + 1] <= 80;
  };
  for (std::size_t i = 0; i < r.frames(); ++i)
    if (inside(i)) {
      const double at = r.position_mm[2 * i + 1];
      n += 1, t += r.time_s[i], y += at, tt += r.time_s[i] * r.time_s[i], ty += r.time_s[i] * at;
    }
  const double rate = (n * ty - t * y) / (n * tt - t * t), start = (y - rate * t) / n;
  double worst = 0;
  for (std::size_t i = 0; i < r.frames(); ++i)
    if (inside(i)) worst = std::max(worst, std::abs(start + rate * r.time_s[i] - r.position_mm[2 * i + 1]));
  return worst;
}

TEST(LostFrames, TheClockIsRestoredWhereSignalsMove) {
  double before = 0, after = 0;
  int n = 0;
  for (const char* plate : {"3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges"})
    for (const int pass : {2, 4, 5, 7}) {
      Recording recording = lossy_pass(plate, pass, 5);
      before += unevenness(recording), ++n;
      restore_clock(recording, kBoardHz);
      after += unevenness(recording);
    }
  EXPECT_GT(before / n, 0.8) << "the passes are not lossy enough to show anything";
  EXPECT_LT(after / n, 0.4);
}

TEST(LostFrames, ALossIsCountedToAFrameOrAFifth) {
  const Recording whole = full_pass("6_Ridges", 4, 3);
  // Where the fastest change is.
  std::size_t at = 1000;
  double most = 0;
  for (std::size_t i = 1000; i + 1000 < whole.frames(); ++i) {
    double change = 0;
    for (std::size_t k = 0; k < rig::kTaxels; ++k)
      change += std::abs(whole.signals[i * rig::kTaxels + k] - whole.signals[(i - 1) * rig::kTaxels + k]);
    if (change > most) most = change, at = i;
  }
  for (const std::size_t lost : {1, 5, 20}) {
    const double tolerance = std::max(1.0, 0.2 * static_cast<double>(lost));
    Recording cut = whole;
    lose(cut, at, lost);
    const std::vector<double> found = find_lost_frames(cut, kBoardHz);
    EXPECT_NEAR(found[at], static_cast<double>(lost), tolerance) << lost;
    EXPECT_EQ(found[at - 1], 0);
    EXPECT_EQ(found[at + 1], 0);
    // A gap that the stamps tell of is not counted twice.
    for (std::size_t i = at; i < cut.frames(); ++i) cut.time_s[i] += static_cast<double>(lost) / kBoardHz;
    EXPECT_LE(find_lost_frames(cut, kBoardHz)[at], tolerance) << lost;
  }
}

TEST(LostFrames, NothingIsFoundWhereNothingIsMissing) {
  Recording whole = full_pass("4_Ridges", 5, 4);
  const double frames = static_cast<double>(whole.frames());
  restore_clock(whole, kBoardHz);
  EXPECT_LT(std::stod(whole.metadata.at("lost_frames")), 0.005 * frames);

  Recording flat = whole;
  std::fill(flat.signals.begin(), flat.signals.end(), 2.44F);
  for (const double lost : find_lost_frames(flat, kBoardHz)) EXPECT_EQ(lost, 0);
  EXPECT_TRUE(find_lost_frames(Recording{}, kBoardHz).empty());
}

TEST(LostFrames, DeadAndSaturatedTaxelsDoNotHideThem) {
  Recording recording = lossy_pass("6_Bumps", 4, 6);
  for (std::size_t i = 0; i < recording.frames(); ++i)
    for (std::size_t k = 0; k < rig::kTaxels; ++k) {
      float& v = recording.signals[i * rig::kTaxels + k];
      if (k % 3 == 0) v = 2.44F;
      if (k % 3 == 1) v = std::max(v, 2.35F);
    }
  const double before = unevenness(recording);
  restore_clock(recording, kBoardHz);
  EXPECT_LT(unevenness(recording), 0.5 * before);
}

}  // namespace supertac::pass_features_test
