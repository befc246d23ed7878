#include "data/registration/registration.h"

#include "tests/data/registration/lossy_pass.h"
#include "tests/support/test.h"

namespace supertac::apply_registration_test {

TEST(ApplyRegistration, FillsPositionsAndStretchesANominalClock) {
  Recording recording = like_the_rig("3_Bumps", 4, 9);
  recording.metadata["time_base"] = "nominal";
  const Registration r = register_pass(recording, Plate::named("3_Bumps"));
  ASSERT_TRUE(r.reliable) << r.reason;
  apply(r, recording, 15.5);
  EXPECT_EQ(recording.metadata.at("registration_reliable"), "yes");
  EXPECT_EQ(recording.metadata.at("time_base"), "registered");
  EXPECT_EQ(recording.position_mm[0], 15.5F);
  const std::size_t a = recording.frames() / 3, b = recording.frames() / 2;
  EXPECT_NEAR((recording.position_mm[2 * b + 1] - recording.position_mm[2 * a + 1]) /
                  (recording.time_s[b] - recording.time_s[a]),
              10, 1e-3);
}

// Ten frames, a quarter of a second apart; the signals are 2 V before frame 5 and 1 V from there on.
Recording step_at_frame_5() {
  Recording recording;
  recording.pass = 2;
  for (int i = 0; i < 10; ++i) {
    recording.time_s.push_back(0.25 * i);
    recording.signals.insert(recording.signals.end(), rig::kTaxels, i < 5 ? 2.0F : 1.0F);
  }
  return recording;
}

Registration lost(double at_s, double seconds) {
  return {.start_mm = 40, .rate = 10, .valid_until_s = 100, .lost_at_s = at_s, .lost_s = seconds};
}

TEST(ApplyRegistration, ALossIsFilledWithALine) {
  Recording r = step_at_frame_5();
  apply(lost(1.25, 1), r, 5.5);
  ASSERT_EQ(r.frames(), 14u);
  const float line[] = {2, 1.8F, 1.6F, 1.4F, 1.2F, 1};
  for (std::size_t i = 4; i < 10; ++i)
    for (const std::size_t k : {0, 15}) EXPECT_FLOAT_EQ(r.signals[i * rig::kTaxels + k], line[i - 4]) << i;
  for (std::size_t i = 0; i < 14; ++i) {
    EXPECT_DOUBLE_EQ(r.time_s[i], 0.25 * static_cast<double>(i));
    EXPECT_EQ(r.position_mm[2 * i], 5.5F);
    EXPECT_EQ(std::isnan(r.position_mm[2 * i + 1]), i >= 5 && i < 9) << i;
  }
  EXPECT_FLOAT_EQ(r.position_mm[2 * 9 + 1], 40 + 10 * 2.25F) << "the line goes on behind the loss";
  EXPECT_EQ(r.metadata.at("registration_lost_s"), "1.000");
}

TEST(ApplyRegistration, ALossAtTheEndsOrOfLessThanAFrameIsLeftOpen) {
  for (const double at_s : {0.0, 0.25, 2.5}) {
    Recording r = step_at_frame_5();
    apply(lost(at_s, 1), r);
    EXPECT_EQ(r.frames(), 10u) << at_s;
    EXPECT_DOUBLE_EQ(r.time_s.back(), at_s < 2.5 ? 3.25 : 2.25) << at_s;
  }
  Recording r = step_at_frame_5();
  apply(lost(1.25, 0.125), r);
  EXPECT_EQ(r.frames(), 10u);
  EXPECT_DOUBLE_EQ(r.time_s[5], 1.375);
}

TEST(ApplyRegistration, PositionsAreLimitedToThePlateAndToWhatWasFitted) {
  Recording r = step_at_frame_5();
  apply({.start_mm = 100, .rate = 10, .valid_from_s = 0.25, .valid_until_s = 1.5}, r);
  EXPECT_TRUE(std::isnan(r.position_mm[1]));
  EXPECT_FLOAT_EQ(r.position_mm[3], 102.5F);
  EXPECT_FLOAT_EQ(r.position_mm[2 * 6 + 1], 108);
  EXPECT_TRUE(std::isnan(r.position_mm[2 * 7 + 1]));
  EXPECT_EQ(r.metadata.at("registration_reliable"), "no");
}

}  // namespace supertac::apply_registration_test
