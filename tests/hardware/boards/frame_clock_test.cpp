#include "hardware/boards/frame_clock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "hardware/virtual_rig/faults.h"

namespace supertac {
namespace {

struct Arrivals {
  std::vector<double> times;
  std::vector<std::uint64_t> index;
  std::uint64_t lost = 0;  // between the first and the last that arrived
};

// Frames of a board with `period`; `loss` of them vanish; every `stall_every` frames the host sleeps for 15
// ms and then finds everything at once.
Arrivals arrivals(std::size_t count, double period, double loss, std::size_t stall_every) {
  Arrivals out;
  Dice dice(5, 5);
  double awake = 0;
  std::uint64_t last = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const double due = 100 + period * static_cast<double>(i);
    if (stall_every > 0 && i % stall_every == stall_every - 1) awake = due + 0.015;
    if (i > 0 && dice.hit(loss)) continue;
    if (!out.index.empty()) out.lost += i - last - 1;
    last = i;
    out.index.push_back(i);
    out.times.push_back(std::max(due + 2e-4 * dice.uniform(), awake));
  }
  return out;
}

TEST(FrameTimeline, CountsEveryMissingFrameAndPlacesItWhereItWas) {
  for (const double loss : {0.0, 0.01, 0.2}) {
    for (const double period : {0.998 * rig::kFramePeriodS, rig::kFramePeriodS, 1.002 * rig::kFramePeriodS}) {
      const Arrivals sent = arrivals(20000, period, loss, 0);
      const FrameTimeline timeline = timeline_of(sent.times);
      EXPECT_EQ(timeline.missing, sent.lost) << "loss " << loss << ", period " << period;
      EXPECT_EQ(timeline.index, sent.index);
      EXPECT_NEAR(timeline.clock.period_s / period, 1, 2e-6);
    }
  }
}

TEST(FrameTimeline, ABurstAfterAStallIsNoLoss) {
  const Arrivals sent = arrivals(20000, rig::kFramePeriodS, 0, 300);
  EXPECT_EQ(timeline_of(sent.times).missing, 0U);
  const Arrivals both = arrivals(20000, rig::kFramePeriodS, 0.01, 300);
  EXPECT_EQ(timeline_of(both.times).missing, both.lost);
}

TEST(ClockEstimator, LowerEnvelopeWithOutliers) {
  ClockEstimator estimator;
  Dice dice(9, 9);
  for (std::uint64_t i = 0; i < 100'000; ++i) {
    double delay = 3e-4 * dice.uniform();
    if (dice.hit(0.3)) delay += 0.02 * dice.uniform();
    estimator.add(i, 50 + 9.93e-4 * static_cast<double>(i) + delay);
  }
  const ClockFit fit = estimator.fit();
  EXPECT_NEAR(fit.period_s, 9.93e-4, 1e-9);
  EXPECT_NEAR(fit.offset_s, 50, 5e-5);
  EXPECT_LT(fit.residual_s, 5e-5);
  EXPECT_TRUE(fit.plausible);
}

TEST(ClockEstimator, WarnsOutsideHalfAPercent) {
  for (const double factor : {0.994, 0.996, 1.004, 1.006}) {
    ClockEstimator estimator;
    for (std::uint64_t i = 0; i < 5000; ++i)
      estimator.add(i, factor * rig::kFramePeriodS * static_cast<double>(i));
    EXPECT_EQ(estimator.fit().plausible, std::abs(factor - 1) <= 0.005) << factor;
  }
}

TEST(JumpDetector, FlagsAFlippedHighBitOnceAndAcceptsALastingChange) {
  JumpDetector detector;
  BoardFrame frame;
  frame.samples.fill(3000);
  EXPECT_FALSE(detector.jump(frame));
  BoardFrame flipped = frame;
  flipped.samples[10] ^= 0x400;
  EXPECT_TRUE(detector.jump(flipped));
  EXPECT_FALSE(detector.jump(frame));
  frame.samples[5] = 2000;
  int flagged = 0;
  for (int i = 0; i < 10; ++i) flagged += detector.jump(frame) ? 1 : 0;
  EXPECT_EQ(flagged, 3);
}

}  // namespace
}  // namespace supertac
