#include "data/windows/windows.h"

#include "data/simulation/simulator.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::signal_remarks_test {

using Remarks = std::vector<std::string>;

Remarks remarks_after(const std::string& plate, void (*change)(Recording&)) {
  Recording recording = simulate_pass(Plate::named(plate), {.from_mm = 30, .to_mm = 60});
  change(recording);
  WindowSet windows((WindowSettings()));
  windows.add(recording);
  return remarks_on(windows, all_of(windows));
}

void set_taxels(Recording& recording, int taxels, float volts) {
  for (std::size_t i = 0; i < recording.frames(); ++i)
    for (int k = 0; k < taxels; ++k) recording.signals[16 * i + static_cast<std::size_t>(k)] = volts;
}

TEST(SignalRemarks, SayNothingWhenAllIsWell) {
  EXPECT_EQ(remarks_after("6_Bumps", [](Recording&) {}), Remarks{});
}

TEST(SignalRemarks, NameDeadTaxels) {
  EXPECT_EQ(remarks_after("6_Bumps", [](Recording& r) { set_taxels(r, 6, 2.41F); }),
            Remarks{"signals 0, 1, 2, 3, 4, 5 never change: dead taxels, or stuck ones"});
}

TEST(SignalRemarks, NameADeadSensor) {
  const std::string dead =
      "no signal changes: the sensor is dead, or its signals lie outside the model's range";
  EXPECT_EQ(remarks_after("6_Bumps", [](Recording& r) { set_taxels(r, 16, 2.41F); }), Remarks{dead});
  EXPECT_EQ(remarks_after("6_Bumps",
                          [](Recording& r) {
                            for (float& v : r.signals) v += 5;
                          }),
            Remarks{dead});
}

TEST(SignalRemarks, NameSaturation) {
  const Remarks remarks = remarks_after("6_Bumps", [](Recording& r) {
    for (float& v : r.signals) v = std::min(v, 2.45F - 8 * (2.45F - v));
  });
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_NE(remarks[0].find(" % of the signals lie at the end of the model's range"), std::string::npos)
      << remarks[0];
}

TEST(SignalRemarks, NameTruthsThatShowNothing) {
  EXPECT_EQ(remarks_after("plain", [](Recording&) {}),
            Remarks{"every truth is 0 everywhere: nothing can be learnt or scored in contact"});
}

}  // namespace supertac::signal_remarks_test
