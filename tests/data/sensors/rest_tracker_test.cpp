#include "data/sensors/rest_tracker.h"

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::rest_tracker_test {

constexpr std::size_t kSignals = 6;
constexpr double kRest = 100, kRange = 500, kHz = 50;

Sensor mat(double follow_rest_s, bool rises = true, int channels = 1) {
  Sensor sensor;
  sensor.array = {.rows = 1, .columns = static_cast<int>(kSignals) / channels, .channels = channels};
  sensor.scale = {.unit = "counts", .rest = kRest, .span = rises ? -kRange : kRange};
  sensor.follow_rest_s = follow_rest_s;
  return sensor;
}

/// What signals are after `seconds`, as shares of the range from rest; `sent` gives those of the sensor.
std::vector<double> after(RestTracker& tracker, double from_s, double seconds,
                          const std::function<double(double, std::size_t)>& sent) {
  const RandomStream random(2, 3);
  std::vector<float> signals(kSignals);
  std::vector<double> sum(kSignals);
  const auto frames = static_cast<std::uint64_t>(seconds * kHz);
  for (std::uint64_t n = 0; n < frames; ++n) {
    const double time = from_s + static_cast<double>(n) / kHz;
    for (std::size_t s = 0; s < kSignals; ++s)
      signals[s] = static_cast<float>(
          kRest + kRange * (sent(time, s) + 0.005 * random.normal(kSignals * (n + 1'000'000) + s)));
    tracker.follow(time, signals);
    if (n + 50 < frames) continue;
    for (std::size_t s = 0; s < kSignals; ++s) sum[s] += (double{signals[s]} - kRest) / kRange / 50;
  }
  return sum;  // means of the last second
}

double zero(double, std::size_t) { return 0; }

TEST(RestTracker, FollowsADriftOfEachSignal) {
  RestTracker tracker(mat(5));
  const auto drift = [](double t, std::size_t s) { return (static_cast<double>(s) - 2.5) * 0.08 * t / 300; };
  for (const double share : after(tracker, 0, 300, drift))
    EXPECT_NEAR(share, 0, 0.006);      // 0.2 is the farthest
  RestTracker falling(mat(5, false));  // of signals that fall under pressure as well
  for (const double share : after(falling, 0, 300, drift)) EXPECT_NEAR(share, 0, 0.006);
}

TEST(RestTracker, ARestThatIsNoLongerThatOfTheFileIsFoundAtTheBeginning) {
  RestTracker tracker(mat(5));
  const auto old = [](double, std::size_t s) { return s % 2 == 0 ? 0.12 : -0.2; };
  EXPECT_NEAR(after(tracker, 0, 2, old)[0], 0.12, 0.03);
  for (const double share : after(tracker, 2, 60, old)) EXPECT_NEAR(share, 0, 0.01);
}

TEST(RestTracker, ATouchIsNotAbsorbed) {
  RestTracker tracker(mat(2));
  after(tracker, 0, 20, zero);
  for (const double press : {0.08, 0.5}) {
    const auto touch = [&](double, std::size_t s) { return s == 3 ? press : s == 4 ? 0.02 : 0; };
    const std::vector<double> felt = after(tracker, 100, 60, touch);
    EXPECT_NEAR(felt[3], press, 0.005);
    EXPECT_NEAR(felt[4], 0.02, 0.005) << "nor what a neighbour feels of it";
    for (const double share : after(tracker, 200, 20, zero)) EXPECT_NEAR(share, 0, 0.003);
  }
}

// What drifts meanwhile is found again afterwards, as fast as it went before.
TEST(RestTracker, FollowsOnBehindALongTouchWhileAllDrifts) {
  for (const double per_s : {2e-4, 1.7e-3}) {
    RestTracker tracker(mat(5));
    const auto drift = [=](double t, std::size_t s) {
      return per_s * t + (s == 3 && t > 25 && t < 55 ? 0.6 : 0);
    };
    EXPECT_NEAR(after(tracker, 0, 25, drift)[0], 5 * per_s, 0.004);
    EXPECT_NEAR(after(tracker, 25, 30, drift)[3], 0.6, 0.07) << "and it is felt";
    for (const double share : after(tracker, 55, 40, drift)) EXPECT_NEAR(share, 5 * per_s, 0.005) << per_s;
  }
}

TEST(RestTracker, ATouchAtTheVeryBeginningIsNoRest) {
  RestTracker tracker(mat(2));
  const auto touch = [](double, std::size_t s) { return s == 0 ? 0.3 : 0.1; };
  const std::vector<double> felt = after(tracker, 0, 60, touch);
  EXPECT_NEAR(felt[0], 0.3, 0.003);
  EXPECT_NEAR(felt[5], 0.1, 0.003);
  EXPECT_NEAR(after(tracker, 60, 10, zero)[0], 0, 0.003);
}

// A small step is drift; a larger one looks like a touch, until it has lasted; the other way nothing presses.
TEST(RestTracker, StepsAreFollowedAsTheirSizeAllows) {
  const auto step = [](double size) { return [size](double, std::size_t s) { return s == 2 ? size : 0; }; };
  for (const double size : {0.02, -0.02, -0.3}) {
    RestTracker tracker(mat(2));
    after(tracker, 0, 20, zero);
    EXPECT_NEAR(after(tracker, 20, 20, step(size))[2], 0, 0.004) << size;
  }
  RestTracker tracker(mat(2));
  after(tracker, 0, 20, zero);
  EXPECT_NEAR(after(tracker, 20, 100, step(0.08))[2], 0.08, 0.003);
  EXPECT_NEAR(after(tracker, 120, 200, step(0.08))[2], 0, 0.003);
  RestTracker pressed(mat(2));
  after(pressed, 0, 20, zero);
  EXPECT_NEAR(after(pressed, 20, 1500, step(0.3))[2], 0.3, 0.003);
}

TEST(RestTracker, OfThreeAxesEitherWayIsATouch) {
  RestTracker tracker(mat(2, true, 3));
  after(tracker, 0, 20, zero);
  const auto dragged = [](double, std::size_t s) { return s == 1 ? -0.1 : 0; };
  EXPECT_NEAR(after(tracker, 20, 60, dragged)[1], -0.1, 0.003);
}

TEST(RestTracker, TakesNoHarmFromNumbersThatAreNone) {
  RestTracker tracker(mat(2));
  const auto half_dead = [](double t, std::size_t s) {
    return s == 1                                   ? std::numeric_limits<double>::quiet_NaN()
           : s == 2 && static_cast<int>(t) % 3 == 0 ? std::numeric_limits<double>::infinity()
                                                    : 0.02;
  };
  const std::vector<double> shares = after(tracker, 0, 60.5, half_dead);
  EXPECT_TRUE(std::isnan(shares[1]));
  for (const std::size_t s : {0U, 3U, 5U}) EXPECT_NEAR(shares[s], 0, 0.003) << s;
  for (const double share : after(tracker, 61, 20, [](double, std::size_t) { return 0.02; }))
    EXPECT_NEAR(share, 0, 0.003);
}

TEST(RestTracker, ChangesNothingUnlessTheFileAsks) {
  EXPECT_EQ(Sensor{}.follow_rest_s, 0);
  RestTracker tracker(Sensor{});
  const RandomStream random(7, 8);
  for (std::uint64_t n = 0; n < 1000; ++n) {
    std::vector<float> signals(16);
    for (std::size_t s = 0; s < 16; ++s) signals[s] = static_cast<float>(2 + random.uniform(16 * n + s));
    const std::vector<float> before = signals;
    tracker.follow(0.001 * static_cast<double>(n), signals);
    ASSERT_EQ(signals, before);
  }
}

}  // namespace supertac::rest_tracker_test
