#include "data/registration/pass_features.h"

#include "tests/support/test.h"

namespace supertac::contacts_test {

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

TEST(Contacts, IgnoresNoiseFlatSignalsAndHoles) {
  EXPECT_TRUE(find_contacts(dips({}, 0)).empty());
  EXPECT_TRUE(find_contacts(dips({2.0}, 0.005)).empty());
  EXPECT_TRUE(find_contacts(Recording{}).empty());
  Recording holes = dips({1.5}, 0.1);
  for (std::size_t i = 700; i < 720; ++i)
    holes.signals[i * rig::kTaxels + 6] = std::numeric_limits<float>::quiet_NaN();
  const auto found = find_contacts(holes);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].time_s, 1.5, 0.005);
}

TEST(Contacts, RefusesArraysThatDoNotFit) {
  Recording recording = dips({1.5}, 0.1);
  recording.signals.pop_back();
  EXPECT_EQ(what_of<std::invalid_argument>([&] { find_contacts(recording); }),
            "find_contacts: 3000 frames need 48000 signals, got 47999");
  recording = dips({1.5}, 0.1);
  recording.time_s.back() = 1e9;
  EXPECT_EQ(what_of<std::invalid_argument>([&] { find_contacts(recording); }),
            "find_contacts: time stamps must increase and span at most 10000 s, got a span of 1e+09 s");
}

}  // namespace supertac::contacts_test
