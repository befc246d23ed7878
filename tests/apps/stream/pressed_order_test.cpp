// An order from presses that are not clean: wired at random, felt by neighbours too, noisy, slow to let go.
#include "apps/stream/pressed_order.h"

#include <nlohmann/json.hpp>

#include "io/numbers/random.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::pressed_order_test {

TEST(PressedOrder, IsTheWiringWhateverIsFeltBesides) {
  const TemporaryFolder folder;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const RandomStream random(seed, 57);
    std::uint64_t next = 0;
    Sensor draft{.array = {.rows = 3, .columns = 5, .channels = 1}, .frame = {.kind = FrameKind::text}};
    const auto shuffled = [&] {
      std::vector<int> order(15);
      std::iota(order.begin(), order.end(), 0);
      for (std::size_t k = 14; k > 0; --k)
        std::swap(order[k],
                  order[static_cast<std::size_t>(random.uniform(next++) * static_cast<double>(k + 1))]);
      return order;
    };
    // As the draft has it, and as it is: at its place 4 nothing answers.
    if (seed % 2 == 0) draft.order = shuffled();
    const std::vector<int> wiring = shuffled();
    for (int k = 0; k < 15; ++k) draft.rest.push_back(static_cast<float>(2 + 0.01 * k));
    const std::string path = folder / "sensor.json";
    write_sensor(path, draft);
    PressedOrder order(draft, {}, path);
    (void)order.start();
    std::vector<double> felt(15);
    const auto press = [&](int place, double strength) {
      for (int n = 0; n < 60; ++n) {
        for (int other = 0; other < 15; ++other) {
          const double away = std::hypot(place / 5 - other / 5, place % 5 - other % 5);
          const double now = n < 25 && away < 2 ? strength * std::exp(-0.5 * away * away) : 0;
          felt[static_cast<std::size_t>(other)] += 0.25 * (now - felt[static_cast<std::size_t>(other)]);
        }
        std::vector<double> loads(15);
        for (std::size_t t = 0; t < 15; ++t) {
          const int at = draft.order.empty() ? static_cast<int>(t) : draft.order[t];
          const auto of = static_cast<std::size_t>(std::ranges::find(wiring, at) - wiring.begin());
          loads[t] = std::abs(felt[of] + 0.002 * random.normal(next++));
        }
        order.push(loads);
      }
    };
    for (int place = 0; place < 15; ++place) {
      ASSERT_EQ(order.status().asked, place) << seed << order.status().says;
      if (place == 7) press(2, 0.2);
      ASSERT_EQ(order.status().asked, place);
      if (place == 4)
        (void)order.skip();
      else
        press(place, 0.05 + 0.2 * random.uniform(next++));
    }
    ASSERT_FALSE(order.status().asked);
    const Sensor found = read_sensor(path);
    EXPECT_EQ(found.order, wiring) << seed;
    EXPECT_EQ(found.dead, std::vector<int>{4});
    for (std::size_t k = 0; k < 15; ++k) {
      const int was = draft.order.empty()
                          ? wiring[k]
                          : static_cast<int>(std::ranges::find(draft.order, wiring[k]) - draft.order.begin());
      EXPECT_FLOAT_EQ(found.rest[k], static_cast<float>(2 + 0.01 * was)) << seed;
    }
  }
}

TEST(PressedOrder, WritesNothingOverAFileThatHasChanged) {
  const TemporaryFolder folder;
  Sensor draft{.array = {.rows = 1, .columns = 1}, .frame = {.kind = FrameKind::text}};
  PressedOrder order(draft, {}, folder / "sensor.json");
  draft.name = "edited meanwhile";
  write_sensor(folder / "sensor.json", draft);
  (void)order.start();
  for (const double load : {0.0, 0.1, 0.0}) order.push({{load}});
  EXPECT_NE(order.status().says.find("is not what the probe wrote any more"), std::string::npos);
  EXPECT_EQ(read_sensor(folder / "sensor.json").name, "edited meanwhile");
}

}  // namespace supertac::pressed_order_test
