#include "data/sensors/rig.h"

#include "hardware/printers/marlin_link.h"
#include "hardware/virtual_rig/virtual_rig.h"
#include "tests/hardware/fake_port.h"
#include "tests/support/test.h"

namespace supertac::virtual_rig_rig_test {

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

TEST(PlainRig, RunsNoDamagedLineAndSaysWhatItDoesNotKnow) {
  PlainRig rig([](double, double, double, double) { return TaxelVolts{}; }, 0);
  const auto said = [&rig](const std::string& line) {
    rig.to_printer(std::as_bytes(std::span(line)));
    return as_text(rig.from_printer());
  };
  const std::string refused = ", Last Line: 0\nResend: 1\nok\n", none = "Error:No Checksum with line number";
  EXPECT_EQ(said(numbered_line(0, "M110 N0")), "ok\n");
  EXPECT_EQ(said("N1 G92 X10*0\n"), "Error:checksum mismatch" + refused);
  EXPECT_EQ(said("N1 G92 X10\n"), none + refused);
  EXPECT_EQ(said(numbered_line(1, "G92 X10").insert(9, 1, '\0')), none + refused) << "the sum is as it was";
  std::int64_t number = 0;
  for (const char* command : {"G92 X10 Y0 Z0", "M108", "G1 X35.4 F1524", "G1 Y50.8"})
    EXPECT_EQ(said(numbered_line(++number, command)), "ok\n") << command;
  EXPECT_EQ(said(numbered_line(number, "G1 Y50.8")), "") << "a repetition";
  EXPECT_EQ(said(numbered_line(++number, "G91")), "echo:Unknown command: \"G91\"\nok\n");
  rig.advance(4);
  EXPECT_TRUE(said(numbered_line(++number, "M114 R")).starts_with("X:35.40 Y:50.80 Z:0"));
}

}  // namespace supertac::virtual_rig_rig_test
