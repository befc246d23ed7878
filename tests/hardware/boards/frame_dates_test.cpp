#include <gtest/gtest.h>

#include <cmath>

#include "hardware/boards/sensor_reader.h"
#include "tests/hardware/fake_sensor.h"

namespace supertac {
namespace {

TEST(FrameDates, ACounterOfMicrosecondsRunsOver) {
  FrameDates dates(mat(1, 2, 100, R"({"kind":"text","time":{"column":0,"unit":"us"}})"));
  const double wrap = 4294.967296;
  double first = 0, last = 0;
  for (int n = 0; n < 200; ++n) {
    const auto time = dates.date(std::fmod(4294 + 0.01 * n, wrap), 100 + 0.01 * n);
    ASSERT_TRUE(time);
    (n == 0 ? first : last) = *time;
  }
  EXPECT_NEAR(last - first, 1.99, 1e-6);
  EXPECT_EQ(dates.missing(), 0U);
}

TEST(FrameDates, AWildStampIsBelievedByNobody) {
  const auto format_of = [](const std::string& type) {
    return R"({"kind":"binary","header":"AA","type":"u16","time":{"type":")" + type + R"(","unit":"ms"}})";
  };
  for (const std::string type : {"u32", "u64", "f64"}) {
    for (const double wild_s : {1e300, -1e300, 4e9, 1e7, 100.0, 3.0, 0.5, -4.0}) {
      for (const int at : {0, 50}) {
        FrameDates dates(mat(1, 2, 100, format_of(type)));
        std::vector<double> times;
        for (int n = 0; n < 200; ++n)
          if (const auto time = dates.date(10 + 0.01 * n + (n == at ? wild_s : 0), 500 + 0.01 * n))
            times.push_back(*time);
        ASSERT_GE(times.size(), 198U) << type << ' ' << wild_s << ' ' << at;
        EXPECT_NEAR(times.back() - times[times.size() - 100], 0.99, 1e-4) << type << ' ' << wild_s;
        const double whole = times.back() - times.front();
        EXPECT_TRUE(at == 0 || std::abs(whole - 1.99) < 1e-9) << type << ' ' << wild_s << ' ' << whole;
      }
    }
  }
  FrameDates dates(mat(1, 2, 100, format_of("u32")));
  std::vector<double> times;
  for (int n = 0; n < 300; ++n) {
    const double stamp_s = n < 100 ? 5000 + 0.01 * n : n < 200 ? 0.01 * n : 60 + 0.01 * n;
    if (const auto time = dates.date(stamp_s, 700 + 0.01 * n)) times.push_back(*time);
  }
  ASSERT_EQ(times.size(), 298U);
  EXPECT_NEAR(times[100] - times[99], 0.02, 1e-9) << "it started anew";
  EXPECT_NEAR(times.back() - times[198], 61, 1e-9) << "it paused";
}

TEST(FrameDates, ASensorFarSlowerThanItsFileSaysLosesNothing) {
  const std::string frame = R"({"kind":"text","time":{"column":0,"unit":"ms"}})";
  FrameDates live(mat(1, 2, 100, frame)), from_file(mat(1, 2, 100, frame));
  int dated = 0, read = 0;
  for (int n = 0; n < 100; ++n) {
    dated += live.date(0.2 * n, 50 + 0.2 * n + 0.03 * (n % 3)) ? 1 : 0;
    read += from_file.date(0.2 * n, 50 + 1e-5 * n) ? 1 : 0;
  }
  EXPECT_EQ(dated, 100);
  EXPECT_EQ(live.missing(), 0U);
  EXPECT_GE(read, 98) << "of a file all comes at once: two frames are doubted";
}

TEST(FrameDates, DatesByArrivalWhereNothingIsStamped) {
  const double rate_hz = 103;
  FrameDates dates(mat(1, 2, 100, R"({"kind":"text"})"));
  double worst_s = 0, last = -1;
  for (int n = 0; n < 6000; ++n) {
    if (n >= 3000 && n < 3060) continue;
    const double made = n / rate_hz, arrival = std::ceil(made / 0.1) * 0.1;
    const auto time = dates.date(std::nullopt, arrival);
    ASSERT_TRUE(time);
    EXPECT_GT(*time, last);
    last = *time;
    if (n > 2000 && (n < 3000 || n > 4500)) worst_s = std::max(worst_s, std::abs(*time - made));
  }
  EXPECT_LT(worst_s, 0.1);
  EXPECT_NEAR(dates.period_s(), 1 / rate_hz, 3e-4);
  EXPECT_NEAR(static_cast<double>(dates.missing()), 60, 12);
}

TEST(FrameDates, AnotherRateThanTheStatedOneIsNoLoss) {
  for (const double made_hz : {25.0, 50.0, 80.0, 88.0, 92.0, 108.0, 125.0, 200.0}) {
    FrameDates dates(mat(1, 2, 100, R"({"kind":"text"})"));
    double last = 0;
    int gaps = 0;
    for (int n = 0; n < 1000; ++n) {
      const auto time = dates.date(std::nullopt, 7 + n / made_hz);
      ASSERT_TRUE(time);
      gaps += n > 0 && *time - last > 0.05;
      EXPECT_TRUE(n < 2 * made_hz || *time - last < 2 / made_hz) << made_hz << ' ' << n;
      last = *time;
    }
    EXPECT_LE(gaps, 1) << made_hz;
    EXPECT_EQ(dates.missing(), 0U) << made_hz;
    EXPECT_NEAR(dates.period_s(), 1 / made_hz, 0.03 / made_hz) << made_hz;
    EXPECT_NEAR(last, 7 + 999 / made_hz, 0.12) << made_hz;
  }
}

TEST(FrameDates, WhatWaitedWhileTheHostStoodStillIsNotLost) {
  for (const int lost : {0, 30}) {
    FrameDates dates(mat(1, 2, 100, R"({"kind":"text"})"));
    double last = 0, longest = 0;
    for (int n = 0; n < 600; ++n) {
      const bool waited = n >= 300 && n < 340;
      if (waited && n < 300 + lost) continue;
      const auto time =
          dates.date(std::nullopt, 0.01 * (waited ? 340 : n), waited ? std::size_t(339 - n) : 0);
      ASSERT_TRUE(time);
      if (n > 0) longest = std::max(longest, *time - last);
      last = *time;
    }
    EXPECT_NEAR(last, 5.99, 0.02);
    EXPECT_LT(longest, 0.01 * lost + 0.025);
    EXPECT_NEAR(static_cast<double>(dates.missing()), lost, 1);
  }
}

TEST(FrameDates, FramesThatArriveAtOnceAreAllDated) {
  for (const double rate_hz : {10.0, 1000.0}) {
    FrameDates dates(mat(1, 2, rate_hz, R"({"kind":"text"})"));
    double last = -1;
    for (int n = 0; n < 1000; ++n) {
      const auto time = dates.date(std::nullopt, n < 500 ? 5 : 5.0001);
      ASSERT_TRUE(time) << n;
      ASSERT_GT(*time, last);
      last = *time;
    }
    EXPECT_LT(last, 5 + 11 / rate_hz);
  }
}

// Several frames share a stamp of milliseconds; none is thrown away, and none is lost.
TEST(FrameDates, AClockMayBeCoarserThanTheFrames) {
  FrameDates dates(mat(1, 2, 1500, R"({"kind":"text","time":{"column":0,"unit":"ms"}})"));
  double last = -1;
  for (int n = 0; n < 3000; ++n) {
    const auto time = dates.date(std::floor(n / 1.5) * 1e-3, 9 + n / 1500.0);
    ASSERT_TRUE(time) << n;
    EXPECT_GT(*time, last);
    EXPECT_NEAR(*time, n / 1500.0, 1.1e-3);
    last = *time;
  }
  EXPECT_EQ(dates.missing(), 0U);
  FrameDates lossy(mat(1, 2, 500, R"({"kind":"text","time":{"column":0,"unit":"ms"}})"));
  for (int n = 0; n < 3000; ++n)
    if (n % 100 != 50) lossy.date(n * 2e-3, 9 + n / 500.0);
  EXPECT_EQ(lossy.missing(), 30U);
}

}  // namespace
}  // namespace supertac
