#include "data/sensors/rig.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

TEST(Rig, NumbersFitEachOther) {
  EXPECT_EQ(rig::kFramePeriodS, 992e-6);
  EXPECT_NEAR(rig::kFrameRateHz * rig::kFramePeriodS, 1, 1e-5);
  EXPECT_EQ(rig::kFilterS, 0.0992);
  EXPECT_EQ(rig::kFrameBytes, 2 + 2 * (rig::kFrameSamples + 1)) << "header, samples, slip, trailer";
  EXPECT_EQ(rig::kTaxels * rig::kPatches, rig::kFrameSamples);
}

TEST(Rig, PassesCrossThePlateSymmetrically) {
  EXPECT_EQ(rig::pass_x_mm(1), 0.5);
  EXPECT_EQ(rig::pass_x_mm(1) + rig::pass_x_mm(rig::kPasses), rig::kPlateWidthMm);
}

TEST(Rig, AdcRoundTrips) {
  EXPECT_EQ(rig::adc_of(2.44), 3029);
  EXPECT_EQ(rig::adc_of(-1), 0);
  EXPECT_EQ(rig::adc_of(9), 4095);
  EXPECT_EQ(rig::adc_of(std::nan("")), 0);
  for (const int code : {0, 1, 3028, 4095}) EXPECT_EQ(rig::adc_of(rig::volts_of(code)), code);
}

}  // namespace
}  // namespace supertac
