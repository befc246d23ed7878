#include "data/frames/probe.h"

#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/text.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/test.h"

namespace supertac::probe_test {

Sensor sensor_of(const std::string& json) { return sensor_of_json(json, "test"); }

// What a sensor sends in so many seconds, a taxel pressed now and then.
std::vector<Heard> sent(const Sensor& sensor, double seconds, bool pressed = true) {
  std::vector<Heard> heard;
  std::uint64_t state = 1;
  for (int n = 0; n < seconds * sensor.rate_hz; ++n) {
    std::vector<double> values;
    for (std::size_t i = 0; i < sensor.values(); ++i) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      const double press = pressed && i == 3 && n % 40 > 30 ? 0.8 : 0;
      const double rest = sensor.rest.empty() ? sensor.scale.rest : double{sensor.rest[i]};
      values.push_back(
          std::round(rest - sensor.scale.span * (0.05 + press) + static_cast<double>(state >> 60)));
      if (i == 5) values.back() = 0;  // dead
    }
    heard.push_back({100 + n / sensor.rate_hz, sent_frame(sensor, values, 3 + n / sensor.rate_hz)});
  }
  return heard;
}

std::string all(const ProbeReport& report) { return joined(report.says, "\n"); }

void expect_said(const ProbeReport& report, const std::string& words) {
  EXPECT_NE(all(report).find(words), std::string::npos) << all(report);
}

// What a probe says that has to end with a draft.
ProbeReport drafted(std::span<const Heard> heard, const std::optional<Sensor>& known = {}) {
  ProbeReport report = probe(heard, "here", known);
  EXPECT_TRUE(report.draft) << all(report);
  if (!report.draft) report.draft = Sensor{};
  return report;
}

TEST(Probe, FindsBinaryFormats) {
  const std::string array =
      R"({"rows":6,"columns":7,"pressed":"lower","range":[500,3900],"rate_hz":100,"frame":)";
  for (
      const char* frame :
      {R"({"kind":"binary","header":"AA55","type":"u16"})",
       R"({"kind":"binary","header":"AA55","type":"u16","endian":"big","checksum":"crc16-ccitt"})",
       R"({"kind":"binary","header":"24","trailer":"21","type":"u16","time":{"type":"u32","unit":"us"}})",
       R"({"kind":"binary","header":"C3","trailer":"0D0A","type":"f32"})",
       R"({"kind":"binary","header":"C3","type":"f32","endian":"big","checksum":"crc16-modbus"})",
       R"({"kind":"binary","header":"AA55","type":"f32","endian":"big","time":{"type":"u32","unit":"us"}})",
       R"({"kind":"binary","header":"A5A5","type":"f32","time":{"type":"u32","unit":"ms"},"checksum":"sum8"})"}) {
    const Sensor sensor = sensor_of(array + frame + "}");
    const ProbeReport report = drafted(sent(sensor, 4));
    const Sensor& draft = *report.draft;
    EXPECT_EQ(draft.values(), 42U) << frame << all(report);
    EXPECT_EQ(draft.frame.type, sensor.frame.type) << frame;
    EXPECT_EQ(draft.frame.big_endian, sensor.frame.big_endian) << frame;
    EXPECT_EQ(draft.frame.checksum, sensor.frame.checksum) << frame;
    EXPECT_EQ(draft.frame.time.has_value(), sensor.frame.time.has_value()) << frame << all(report);
    EXPECT_FALSE(draft.scale.rises()) << frame << all(report);
    EXPECT_EQ(draft.dead, std::vector{5}) << frame;
    EXPECT_NEAR(draft.rate_hz, 100, 1) << frame;
    EXPECT_EQ(draft.port, "here");
    EXPECT_EQ(draft.body, Body{}) << "what somebody's sensor is built of nobody knows: the rig's is no guess";
  }
}

// A terminal that was not yet raw has made line feeds of carriage returns.
TEST(Probe, TheBeginningMayBeDamaged) {
  const Sensor sensor =
      sensor_of(R"({"rows":3,"columns":5,"pressed":"higher","range":[-2000,2000],"rate_hz":100,
    "frame":{"kind":"binary","header":"C3","trailer":"0D0A","type":"f32"}})");
  std::vector<Heard> heard = sent(sensor, 3);
  for (std::size_t n = 0; n < 30; ++n) std::ranges::replace(heard[n].bytes, '\r', '\n');
  const ProbeReport report = drafted(heard);
  EXPECT_EQ(report.draft->frame.header, "\xC3");
  EXPECT_EQ(report.draft->frame.trailer, "\r\n");
  EXPECT_EQ(report.draft->values(), 15U);
}

TEST(Probe, KnowsAClockThatStartsAnewMeanwhile) {
  const std::string array =
      R"({"rows":3,"columns":3,"pressed":"higher","range":[0,900],"rate_hz":100,"frame":)";
  for (const char* frame :
       {R"({"kind":"text","separator":",","time":{"column":0,"unit":"ms"}})",
        R"({"kind":"binary","header":"AA55","type":"u16","time":{"type":"u32","unit":"ms"}})",
        R"({"kind":"json","values":"v","time":{"key":"t","unit":"ms"}})"}) {
    const Sensor sensor = sensor_of(array + frame + "}");
    std::vector<Heard> heard = sent(sensor, 2);
    for (Heard chunk : sent(sensor, 2))
      heard.push_back({chunk.time_s + 3, chunk.bytes});  // a second to start
    const ProbeReport report = drafted(heard);
    ASSERT_TRUE(report.draft->frame.time) << frame << all(report);
    EXPECT_EQ(report.draft->frame.time->unit_s, 1e-3) << frame;
    EXPECT_EQ(report.draft->values(), 9U) << frame;
    EXPECT_NEAR(report.draft->rate_hz, 100, 1) << frame;
  }
}

TEST(Probe, TakesNoNoiseOfFewLinesForAClock) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RandomStream random(seed, 7);
    std::vector<Heard> heard;
    for (std::uint64_t n = 0; n < 6; ++n) {
      std::string line;
      for (std::uint64_t k = 0; k < 16; ++k)
        line += std::to_string(static_cast<int>(4 * random.uniform(16 * n + k))) + (k < 15 ? "\t" : "\n");
      heard.push_back({static_cast<double>(n), line});
    }
    const ProbeReport report = drafted(heard);
    EXPECT_EQ(report.draft->values(), 16U) << all(report);
  }
}

TEST(Probe, FindsAnArrayWithinAnObject) {
  std::vector<Heard> heard;
  for (int n = 0; n < 60; ++n) {
    const std::string stamp = std::to_string(50 + 10'000'000 * n), value = std::to_string(30 + n % 3);
    heard.push_back(
        {0.01 * n, R"({"finger":{"ns":)" + stamp + R"(,"taxels":[[1,)" + value + "],[3,4]]},\"n\":7}\n"});
  }
  const ProbeReport report = drafted(heard);
  EXPECT_EQ(report.draft->frame.values, "/finger/taxels");
  EXPECT_EQ(report.draft->frame.time->key, "/finger/ns");
  EXPECT_EQ(report.draft->frame.time->unit_s, 1e-9);
  EXPECT_EQ(report.draft->array.rows, 2);
  for (Heard& chunk : heard)
    chunk.bytes = R"({"s0":1,"s1":2,"s2":3})"
                  "\n";
  const ProbeReport refused = probe(heard, "here", {});
  EXPECT_FALSE(refused.draft);
  expect_said(refused, "JSON without an array");
}

TEST(Probe, InventsNoRateForAFileWithoutClock) {
  const Sensor sensor = sensor_of(
      R"({"rows":3,"columns":3,"range":[0,900],"rate_hz":100,"frame":{"kind":"text","separator":","}})");
  std::vector<Heard> heard = sent(sensor, 2);
  for (Heard& chunk : heard) chunk.time_s = 5;
  const ProbeReport report = drafted(heard);
  expect_said(report, "assumed: 100 frames a second; set \"rate_hz\"");
}

TEST(Probe, SaysWhatItAssumes) {
  const Sensor sensor = sensor_of(R"({"rows":2,"columns":6,"pressed":"higher","range":[100,900],"rate_hz":50,
    "frame":{"kind":"text","separator":";","skip":[1],"time":{"column":0,"unit":"ms"}}})");
  const ProbeReport report = drafted(sent(sensor, 3, false));
  EXPECT_EQ(report.draft->frame.skip, std::vector{1});
  EXPECT_EQ(report.draft->frame.time->unit_s, 1e-3);
  expect_said(report, "assumed: 3x4 taxels");
  expect_said(report, "nothing was pressed");
  expect_said(report, "stuck or dead, since they never changed: taxels [5]");
  expect_said(report,
              "columns that are no signal (words, a counter, a clock of no known unit) are "
              "skipped: [1]");
  const ProbeReport known = drafted(sent(sensor, 3), sensor);
  EXPECT_EQ(known.draft->array, sensor.array);
  EXPECT_TRUE(known.draft->scale.rises());
  EXPECT_EQ(all(known).find("assumed"), std::string::npos) << all(known);
  const ProbeReport other = probe(sent(sensor, 3), "here", Sensor{.array = {.rows = 5, .columns = 5}});
  EXPECT_FALSE(other.draft);
  expect_said(other, "frames of 12 values, expected the 25 of 5x5 taxels");
}

// Ten rows of six that a frame sends forwards and backwards in turn; a finger here and there; place 5 is
// dead.
TEST(Probe, FindsTheLayoutFromWhatNeighboursFeel) {
  const RandomStream random(3, 1);
  Sensor sensor = sensor_of(R"({"rows":10,"columns":6,"pressed":"higher","range":[100,900],"rate_hz":50,
    "frame":{"kind":"text","separator":","}})");
  std::vector<Heard> heard;
  for (int n = 0; n < 1000; ++n) {
    const auto finger = static_cast<std::uint64_t>(n / 25);
    const double y = 10 * random.uniform(2 * finger) - 0.5, x = 6 * random.uniform(2 * finger + 1) - 0.5;
    std::vector<double> values;
    for (int k = 0; k < 60; ++k) {
      const int row = k / 6, column = row % 2 == 0 ? k % 6 : 5 - k % 6;
      const double press =
          n % 25 < 12 ? 500 * std::exp(-(std::pow(row - y, 2) + std::pow(column - x, 2)) / 2) : 0;
      values.push_back(k == 5 ? 100
                              : std::round(100 + press +
                                           3 * random.normal(1000 + static_cast<std::uint64_t>(60 * n + k))));
    }
    heard.push_back({100 + n / 50.0, sent_frame(sensor, values, n / 50.0)});
  }
  const ProbeReport report = drafted(heard);
  expect_said(report, "taxels side by side feel alike: 10 rows of 6, every second one sent backwards");
  EXPECT_EQ(report.draft->array.rows, 10);
  EXPECT_EQ(report.draft->order[6], 11) << "the second row begins with the last that is sent of it";
  EXPECT_EQ(report.draft->dead, std::vector{5});
  expect_said(report, "assumed: taxels 3 mm apart");
}

TEST(Probe, WritesWhereEachTaxelRests) {
  Sensor sensor = sensor_of(R"({"rows":3,"columns":4,"pressed":"higher","range":[100,900],"rate_hz":50,
    "frame":{"kind":"text"}})");
  const ProbeReport even = drafted(sent(sensor, 3), sensor);
  EXPECT_TRUE(even.draft->rest.empty()) << all(even);
  for (int k = 0; k < 12; ++k) sensor.rest.push_back(static_cast<float>(100 + 10 * k));
  const ProbeReport report = drafted(sent(sensor, 3), sensor);
  ASSERT_EQ(report.draft->rest.size(), 12U);
  for (const std::size_t k : {0U, 1U, 4U, 6U, 11U})  // the fifth is dead; noise is 0 to 15
    EXPECT_NEAR(report.draft->rest[k], sensor.rest[k] + 0.05F * 800, 16) << k;
  expect_said(report, "signals rest up to 1");
}

// A mat whose taxels are each pressed for most of the time, and let go all at once for a fifth of it.
TEST(Probe, TellsRestFromPressuresThatLastLonger) {
  for (const double sign : {1.0, -1.0}) {
    std::vector<Heard> heard;
    for (int n = 0; n < 500; ++n) {
      std::string line;
      for (int k = 0; k < 20; ++k) {
        const double rest = 2000 + 10 * k,
                     noise = RandomStream(3, 1).normal(static_cast<std::uint64_t>(20 * n + k));
        const bool pressed = n % 100 >= 20 && (n / 7 + k) % 20 < (k < 10 ? 16 : 3);
        line += (k > 0 ? "," : "") +
                format(std::round(rest + sign * (pressed ? 900 + 50 * (n % 9) : 0) + 4 * noise));
      }
      heard.push_back({100 + 0.02 * n, line + "\n"});
    }
    const ProbeReport report = drafted(heard);
    EXPECT_EQ(report.draft->scale.rises(), sign > 0) << all(report);
    ASSERT_EQ(report.draft->rest.size(), 20U) << all(report);
    for (std::size_t k = 0; k < 20; ++k)
      EXPECT_NEAR(double{report.draft->rest[k]}, 2000 + 10 * static_cast<double>(k), 2) << k;
    EXPECT_NEAR(std::abs(report.draft->scale.span), 1.1 * 1300, 30);
  }
}

// docs/sensors.md: probe again when the rests have drifted.
TEST(Probe, AtRestKeepsWhatItsFileSaysButTheRests) {
  const Sensor sensor = sensor_of(
      R"({"rows":2,"columns":4,"unit":"ohm","pressed":"lower","range":[300,900],"rate_hz":50,"dead":[5],
    "rest":[900,910,890,900,950,900,905,900],"frame":{"kind":"text"}})");
  Sensor drifted = sensor;
  for (float& rest : drifted.rest) rest += 40;
  const ProbeReport report = drafted(sent(drifted, 4, false), sensor);
  EXPECT_EQ(report.draft->scale.unit, "ohm");
  EXPECT_EQ(report.draft->scale.rest, 900);
  EXPECT_EQ(report.draft->scale.span, 600);
  ASSERT_EQ(report.draft->rest.size(), 8U);
  for (const std::size_t i : {0U, 1U, 2U, 3U, 4U, 6U, 7U})
    EXPECT_NEAR(report.draft->rest[i], drifted.rest[i] - 0.05 * 600 + 8, 3) << i;
  expect_said(report, "stay as the file has them");
}

// A host that opens a port late may get what waited there: a jump of the clock, and of a clock in no known
// unit a column that only rises.
TEST(Probe, TakesNoClockForATaxel) {
  std::vector<Heard> heard;
  for (int n = 0; n < 100; ++n) {
    const int at = n % 7 == 6 ? n - 1 : n;  // some stamps are those of the frame before
    const double ms = 20 * at + (n > 30 ? 12'000 : 0), noise = n * 7 % 5;
    heard.push_back({100 + 0.02 * n, format(ms) + "," + format(ms * 77) + "," + format(100.1 + noise) + "," +
                                         format(120 - noise) + "\n"});
  }
  const ProbeReport report = drafted(heard);
  ASSERT_TRUE(report.draft->frame.time) << all(report);
  EXPECT_EQ(report.draft->frame.time->column, 0);
  EXPECT_EQ(report.draft->frame.time->unit_s, 1e-3);
  EXPECT_EQ(report.draft->frame.skip, std::vector{1});
  EXPECT_EQ(report.draft->values(), 2U);
  expect_said(report, "at rest 102.1 to 118,");
}

TEST(Probe, SaysThatNoLineEnds) {
  const ProbeReport report = probe(std::vector<Heard>{{1, std::string(9000, '7')}, {4, "1,2,3"}}, "here", {});
  expect_said(report, "no line ends");
}

// What is kept of a file: the draft says of taxels, as the file does, not of places in a frame.
TEST(Probe, KeepsTheOrderOfItsFile) {
  Sensor sensor = sensor_of(R"({"name":"cross","rows":3,"columns":3,"pressed":"higher","range":[100,900],
    "rate_hz":50,"frame":{"kind":"text"},"order":[6,-1,0,1,2,3,4,5,-1],"dead":[0]})");
  for (int k = 0; k < 9; ++k) sensor.rest.push_back(static_cast<float>(100 + 10 * k));
  sensor.gain.assign(9, 2), sensor.follow_rest_s = 7;
  sensor.body = {.shape = BodyShape::cylinder, .radius_mm = 30, .skin_mm = 3, .knee = 0.7};
  const ProbeReport report = drafted(sent(sensor, 3), sensor);
  EXPECT_EQ(report.draft->name, "cross");
  EXPECT_EQ(report.draft->order, sensor.order);
  EXPECT_EQ(report.draft->gain, sensor.gain);
  EXPECT_EQ(report.draft->follow_rest_s, 7);
  EXPECT_EQ(report.draft->body, sensor.body);
  EXPECT_EQ(report.draft->dead, (std::vector{0, 7})) << "the sixth place is the stuck one";
  ASSERT_EQ(report.draft->rest.size(), 9U);
  for (const std::size_t place : {0U, 1U, 4U})
    EXPECT_NEAR(report.draft->rest[place + 2], sensor.rest[place] + 0.05F * 800, 16) << place;
}

// A flat plate on one row after the other, twice; the last taxel lies under none, the first is dead.
std::vector<Heard> pressed_by_rows(const Sensor& sensor, std::span<const double> gain, double noise) {
  const RandomStream random(3, 4);
  std::vector<Heard> heard;
  const int channels = sensor.array.channels, columns = sensor.array.columns;
  const int period = static_cast<int>(3 * sensor.rate_hz);  // of a press, of which it holds a third
  for (int n = 0; n < 2 * sensor.array.rows * period; ++n) {
    std::vector<double> values;
    for (int s = 0; s < static_cast<int>(sensor.values()); ++s) {
      const int taxel = s / channels;
      const double along = std::clamp(5 * (1 - std::abs(3.0 * (n % period) / period - 1.5)), 0.0, 1.0);
      const bool under =
          n / period % sensor.array.rows == taxel / columns && taxel + 1 < sensor.array.taxels();
      const double direction = s % channels == 1 ? -0.5 : 1, force = under ? along : 0;
      const double change = 60 * gain[static_cast<std::size_t>(taxel)] * direction * force;
      const double own =
          noise * random.normal(static_cast<std::uint64_t>(n) * 1000 + static_cast<std::uint64_t>(s));
      values.push_back(taxel == 0 ? 0 : std::round(100 + taxel % 7 + change + own));
    }
    heard.push_back({100 + n / sensor.rate_hz, sent_frame(sensor, values, n / sensor.rate_hz)});
  }
  return heard;
}

TEST(FindGain, RecoversWhatTaxelsHaveInCountsAndNoise) {
  const RandomStream random(11, 2);
  for (const int channels : {1, 3}) {
    Sensor sensor = sensor_of(R"({"rows":8,"columns":8,"pressed":"higher","range":[100,200],"rate_hz":50,
      "frame":{"kind":"text"},"dead":[0]})");
    sensor.array.channels = channels;
    std::vector<double> gain;
    for (std::uint64_t k = 0; k < 64; ++k) gain.push_back(std::exp(0.3 * random.normal(k)));
    const ProbeReport report = find_gain(pressed_by_rows(sensor, gain, 0.7), sensor);
    ASSERT_TRUE(report.draft) << all(report);
    const Sensor& found = *report.draft;
    ASSERT_EQ(found.gain.size(), 64U * static_cast<std::size_t>(channels));
    std::vector<double> product;  // alike when the gains are right
    for (std::size_t k = 1; k < 63; ++k) {
      const std::size_t s = k * static_cast<std::size_t>(channels);
      product.push_back(gain[k] * double{found.gain[s]});
      EXPECT_EQ(found.gain[s], found.gain[s + static_cast<std::size_t>(channels) - 1]);
      EXPECT_NEAR(found.rest[s], 100 + static_cast<double>(k % 7), 1) << k;
    }
    const double usual = median(std::vector(product));
    for (const double value : product) EXPECT_NEAR(value / usual, 1, 0.04);
    EXPECT_EQ(found.gain.front(), 1);
    EXPECT_EQ(found.gain.back(), 1);
    EXPECT_EQ(found.dead, std::vector{0});
    expect_said(report, "taxels [63] keep gain 1; press them as hard");
  }
}

TEST(FindGain, IsLimitedAndSaysWhenNothingWasPressed) {
  const Sensor sensor = sensor_of(R"({"rows":4,"columns":4,"pressed":"higher","range":[100,200],"rate_hz":50,
    "frame":{"kind":"text"},"dead":[0]})");
  std::vector<double> gain(16, 1);
  gain[5] = 12;
  const ProbeReport report = find_gain(pressed_by_rows(sensor, gain, 0.7), sensor);
  ASSERT_TRUE(report.draft) << all(report);
  EXPECT_FLOAT_EQ(report.draft->gain[5], 0.2F);
  EXPECT_NEAR(report.draft->gain[6], 1, 0.05);
  for (const auto& [heard, words] : {std::pair(pressed_by_rows(sensor, std::vector<double>(16, 0), 0.7),
                                               std::string("nothing was pressed: press every taxel")),
                                     {std::vector<Heard>(), "0 frames to find gains from"}}) {
    const ProbeReport none = find_gain(heard, sensor);
    EXPECT_FALSE(none.draft);
    expect_said(none, words);
  }
}

TEST(Probe, OfAnythingEndsAndHasADraftThatReads) {
  const RandomStream stream(9, 0);
  std::uint64_t at = 0;
  const auto random = [&](std::uint64_t below) { return stream.bits(at++) % below; };
  const Sensor mat =
      sensor_of(R"({"rows":4,"columns":4,"pressed":"higher","range":[0,900],"frame":{"kind":"text"}})");
  for (int run = 0; run < 60; ++run) {
    std::vector<Heard> heard = sent(mat, 0.5);
    for (Heard& chunk : heard)
      for (std::size_t n = random(4); n > 0 && !chunk.bytes.empty(); --n)
        chunk.bytes[random(chunk.bytes.size())] = static_cast<char>(random(run % 2 == 0 ? 256 : 64));
    const ProbeReport report = probe(heard, "here", {});
    EXPECT_FALSE(report.says.empty());
    if (report.draft) report.draft->check();  // throws nothing
  }
}

}  // namespace supertac::probe_test
