#include "hardware/boards/frame_clock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/hardware/virtual_rig/faults.h"

namespace supertac {
namespace {

struct Arrivals {
  std::vector<FrameArrival> times;
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
    out.times.push_back({std::max(due + 2e-4 * dice.uniform(), awake)});
  }
  return out;
}

TEST(FrameTimeline, CountsEveryMissingFrameAndPlacesItWhereItWas) {
  for (const double loss : {0.0, 0.01, 0.2}) {
    for (const double period : {0.998 * rig::kFramePeriodS, rig::kFramePeriodS, 1.002 * rig::kFramePeriodS}) {
      const Arrivals sent = arrivals(20000, period, loss, 0);
      const FrameTimeline timeline = timeline_of(sent.times);
      EXPECT_EQ(timeline.missing, sent.lost) << "loss " << loss << ", period " << period;
      for (std::size_t i = 0; i < sent.index.size(); ++i)
        ASSERT_EQ(timeline.places[i].index, sent.index[i]) << "frame " << i << ", loss " << loss;
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

/// A host that stands still for `stall_s` at frame 4,000 and then finds `held` frames in its port, two
/// terminals of them at once and the rest in reads of 24; the frames after those were lost.
struct StalledHost {
  StalledHost(double stall_s, std::uint64_t held) {
    const double wakes = 100 + rig::kFramePeriodS * 4000 + stall_s;
    for (std::uint64_t i = 0; i < 20'000; ++i) {
      const double due = 100 + rig::kFramePeriodS * static_cast<double>(i);
      const bool waits = i >= 4000 && due < wakes;
      if (waits && i >= 4000 + held) continue;
      index.push_back(i);
      const auto read = static_cast<double>((i - 4000) / 24);
      arrivals.push_back({waits ? wakes + 5e-5 * read : due + 1e-4, 0, waits && (i - 4000) / 24 < held / 24});
    }
  }
  std::vector<FrameArrival> arrivals;
  std::vector<std::uint64_t> index;
};

TEST(FrameTimeline, WhatWaitedThroughAStallIsDatedRightOrDoubted) {
  for (const double stall_s : {0.02, 0.1, 0.3, 1.7}) {
    for (const std::uint64_t held : {24U, 25U, 96U, 136U}) {
      const StalledHost host(stall_s, held);
      const FrameTimeline timeline = timeline_of(host.arrivals);
      std::size_t doubted = 0;
      for (std::size_t i = 0; i < host.index.size(); ++i) {
        const FramePlace& place = timeline.places[i];
        const auto off = static_cast<double>(place.index) - static_cast<double>(host.index[i]);
        ASSERT_LE(std::abs(off), place.doubt)
            << "frame " << i << ", " << stall_s << " s, " << held << " held";
        doubted += place.doubt > 0 ? 1 : 0;
      }
      EXPECT_LE(doubted, held + 3);
      EXPECT_EQ(host.index.size() + timeline.missing, 20'000U);
    }
  }
}

TEST(FrameTimeline, ChunksAreNoLoss) {
  Dice dice(3, 3);
  for (const double chunk_s : {0.002, 0.02, 0.1}) {
    std::vector<FrameArrival> arrivals;
    double due = 100;
    for (int i = 0; i < 30'000; ++i) {
      const double made = 100 + rig::kFramePeriodS * i;
      while (due < made) due += chunk_s * (0.5 + 0.5 * dice.uniform());
      arrivals.push_back({due});
    }
    const FrameTimeline timeline = timeline_of(arrivals);
    EXPECT_LE(timeline.missing, 1U) << chunk_s;
    EXPECT_NEAR(timeline.clock.at(20'000) - 100 - rig::kFramePeriodS * 20'000, 0, 1.5e-3) << chunk_s;
  }
}

// What waited before a loss is read by and by, so that a burst which began in time ends late.
TEST(FrameTimeline, ALossWithinABurstMovesNothingBeforeIt) {
  std::vector<FrameArrival> arrivals;
  std::vector<std::uint64_t> numbers;
  const auto read = [&](std::uint64_t first, std::uint64_t last, double late_s, bool more_waited) {
    const double time = 100 + rig::kFramePeriodS * static_cast<double>(last) + late_s;
    for (std::uint64_t i = first; i <= last; ++i)
      arrivals.push_back({time, 0, more_waited}), numbers.push_back(i);
  };
  for (std::uint64_t i = 0; i < 400; ++i) read(50 * i, 50 * i + 49, i % 2 == 0 ? 0.004 : 1e-4, false);
  read(20'000, 20'049, 0, true);
  read(20'700, 20'749, 0, false);
  for (std::uint64_t i = 415; i < 600; ++i) read(50 * i, 50 * i + 49, i % 2 == 0 ? 0.004 : 1e-4, false);
  const FrameTimeline timeline = timeline_of(arrivals);
  EXPECT_EQ(timeline.missing, 650U);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    ASSERT_LE(std::abs(static_cast<double>(timeline.places[i].index) - static_cast<double>(numbers[i])),
              timeline.places[i].doubt)
        << "frame " << i;
  EXPECT_EQ(timeline.places[19'000].doubt, 0U);
}

TEST(FrameTimeline, DamagedFramesKeepTheirPlaceInAChunk) {
  EXPECT_EQ(damaged_frames(0), 0U);
  EXPECT_EQ(damaged_frames(1), 0U);
  EXPECT_EQ(damaged_frames(80), 1U);
  for (const std::uint64_t bytes : {163U, 164U, 165U}) EXPECT_EQ(damaged_frames(bytes), 1U);
  EXPECT_EQ(damaged_frames(327), 2U);
  std::vector<FrameArrival> arrivals;
  for (int i = 0; i < 5000; ++i)
    if (i % 50 != 25)
      arrivals.push_back({100 + 50 * rig::kFramePeriodS * std::ceil(i / 50.0), i % 50 == 26 ? 1U : 0U});
  const FrameTimeline timeline = timeline_of(arrivals);
  EXPECT_EQ(timeline.places[120].index - timeline.places[20].index, 102U);
  EXPECT_EQ(timeline.missing, 100U);
}

TEST(LiveDates, ChunksCostLatencyAndNoGap) {
  LiveDates live;
  std::vector<double> dates, all;
  for (int i = 1; i <= 100; ++i) {
    const std::vector<std::uint32_t> steps(static_cast<std::size_t>(100 + i % 2), 1);
    live.date(10 + 0.1 * i, false, steps, dates);
    all.insert(all.end(), dates.begin(), dates.end());
    EXPECT_LE(dates.back(), 10 + 0.1 * i + 1e-9) << "before it was read";
  }
  for (std::size_t i = 1; i < all.size(); ++i) {
    ASSERT_GT(all[i], all[i - 1]);
    ASSERT_LT(all[i] - all[i - 1], 2.5 * rig::kFramePeriodS) << "frame " << i;
  }
}

TEST(LiveDates, FramesLostInAStallAreAGapBehindWhatHadWaited) {
  LiveDates live;
  std::vector<double> dates;
  const auto read = [&](double time_s, std::size_t count, bool more) {
    live.date(time_s, more, std::vector<std::uint32_t>(count, 1), dates);
    return dates.back();
  };
  for (int i = 0; i <= 500; ++i) read(10 + rig::kFramePeriodS * i, 1, false);
  const double before = 10 + rig::kFramePeriodS * 500;
  EXPECT_NEAR(read(before + 1, 24, true), before + rig::kFramePeriodS * 24, 1e-3);
  EXPECT_NEAR(read(before + 1.0001, 10, false), before + rig::kFramePeriodS * 34, 1e-3);
  const double next = before + 1.001;
  EXPECT_NEAR(read(next, 1, false), next, 2e-3);
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
