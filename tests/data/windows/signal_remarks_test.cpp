#include "data/windows/windows.h"

#include "data/simulation/simulator.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::signal_remarks_test {

void set_taxels(Recording& recording, int taxels, float volts) {
  for (std::size_t i = 0; i < recording.frames(); ++i)
    for (int k = 0; k < taxels; ++k) recording.signals[16 * i + static_cast<std::size_t>(k)] = volts;
}

TEST(SignalRemarks, NameDeadTaxelsADeadSensorSaturationAndTruthsThatShowNothing) {
  const char* const dead =
      "no signal changes: the sensor is dead, or its signals lie outside the model's range";
  const std::tuple<const char*, void (*)(Recording&), std::string> cases[] = {
      {"6_Bumps", [](Recording&) {}, ""},
      {"6_Bumps", [](Recording& r) { set_taxels(r, 6, 2.41F); },
       "signals 0, 1, 2, 3, 4, 5 never change: dead taxels, or stuck ones"},
      {"6_Bumps", [](Recording& r) { set_taxels(r, 16, 2.41F); }, dead},
      {"6_Bumps", [](Recording& r) { set_taxels(r, 16, 5); }, dead},
      {"6_Bumps",
       [](Recording& r) {
         for (float& v : r.signals) v = std::min(v, 2.45F - 8 * (2.45F - v));
       },
       " % of the signals lie at the end of the model's range: saturated, or clipped"},
      {"plain", [](Recording&) {},
       "every truth is 0 everywhere: nothing can be learnt or scored in contact"}};
  for (const auto& [plate, change, remark] : cases) {
    Recording recording = simulate_pass(Plate::named(plate), {.from_mm = 30, .to_mm = 60});
    change(recording);
    WindowSet windows((WindowSettings()));
    windows.add(recording);
    const std::vector<std::string> remarks = remarks_on(windows, all_of(windows));
    ASSERT_EQ(remarks.size(), remark.empty() ? 0U : 1U) << remark;
    if (!remarks.empty()) {
      EXPECT_TRUE(remarks[0].ends_with(remark)) << remarks[0];
    }
  }
}

}  // namespace supertac::signal_remarks_test
