// Binary layouts that nobody has tried, from a seeded generator: what the probe drafts is right, or it drafts
// nothing and says why.

#include <functional>
#include <nlohmann/json.hpp>

#include "data/frames/binary_columns.h"
#include "data/frames/sensor_decoder.h"
#include "tests/data/frames/binary_layouts.h"

namespace supertac::probe_binary_test {

// The criterion was tuned on seeds 1 to 70 and 1001 to 1067 of each.
enum class Family { tuned, second, third };
Layout layout_of(std::uint64_t seed, Family family) {
  const bool second = family == Family::second, third = family == Family::third;
  Draws dice(seed, third ? 777 : second ? 77 : 7);
  Layout layout;
  Sensor& sensor = layout.sensor;
  FrameFormat& f = sensor.frame;
  f = {.kind = FrameKind::binary};
  const auto shape =
      third ? dice.of<std::pair<int, int>>({{2, 5}, {4, 7}, {7, 5}, {8, 12}, {11, 13}, {20, 20}, {3, 4}})
      : second
          ? dice.of<std::pair<int, int>>({{2, 3}, {5, 5}, {3, 7}, {9, 9}, {6, 10}, {14, 14}, {24, 20}})
          : dice.of<std::pair<int, int>>(
                {{2, 2}, {3, 3}, {4, 4}, {2, 6}, {6, 6}, {8, 8}, {10, 10}, {12, 32}, {16, 16}, {16, 32}});
  sensor.array = {.rows = shape.first, .columns = shape.second};
  f.type = dice.of<std::string>({"u8", "u8", "u16", "u16", "u16", "i16", "f32", "u32", "i32", "i8"});
  f.big_endian = dice.chance(0.5);
  const std::size_t header = third ? 2 + dice.below(3) : second ? 1 + dice.below(3) : dice.below(5);
  const std::string often[] = {"\xAA", "\xAA\x55", "\xA5\x5A\xA5", "\xFF\xFE\xFD\xFC"};
  if (header > 0) f.header = dice.chance(third ? 0.3 : 0.6) ? often[header - 1] : random_bytes(dice, header);
  if (second && dice.chance(0.3))
    f.header = dice.of<std::string>({"\xEB\x90", "$", "\x5A", "SUP", "\x10\x02"});
  const bool checked = f.header.empty() || dice.chance(0.4);
  if (checked) {
    f.checksum = dice.of<std::string>(
        {"sum8", "xor8", "sum16", "crc8", "crc16-modbus", "crc16-ccitt", "crc16-xmodem", "crc32"});
    if (dice.chance(0.4)) f.checksum_from = 0;
    if (dice.chance(0.3)) f.checksum_big_endian = !f.big_endian;
  }
  if (dice.chance(0.3))
    f.trailer = third    ? dice.of<std::string>({"\x7E", "\n\n", "\xDD", "*"})
                : second ? dice.of<std::string>({"\x03", "\x55\xAA", "END"})
                         : dice.of<std::string>({"\r\n", "\n", "\x0D", "!"});
  using Is = FrameField::Is;
  const std::size_t values = sensor.array.signals();
  if (dice.chance(0.3)) {
    f.time = FrameTime{.type = dice.of<std::string>({"u32", "u32", "u16", "u64"}),
                       .unit_s = dice.of({1e-3, 1e-6})};
    if (f.time->type == "u16") f.time->unit_s = 1e-3;
  }
  if (dice.chance(0.3)) {
    const FrameField counter{Is::counter, 0, dice.of<std::string>({"u8", "u16", "u32"})};
    f.fields = {{Is::values, values, ""}};
    if (f.time) f.fields.insert(f.fields.begin(), {Is::time, 0, ""});
    f.fields.insert(dice.chance(0.7) ? f.fields.begin() : f.fields.end(), counter);
  }
  sensor.rate_hz = third ? dice.of({12.5, 30.0, 80.0, 250.0}) : dice.of({20.0, 50.0, 100.0, 200.0, 500.0});
  send(layout, dice, third);
  return layout;
}

// Layouts of which a checksum, a counter or a part of them was once drafted as values.
Layout odd_layout_of(std::uint64_t seed, int kind) {
  struct Odd {
    int rows, columns;
    std::string type, clock, counter, checksum, trailer;
    bool rests;
  };
  const Odd odd = std::vector<Odd>{{16, 32, "i32", "", "u32", "crc16-ccitt", "END", false},
                                   {2, 3, "i8", "", "u8", "none", "", false},
                                   {16, 32, "f32", "u32", "u16", "none", "", false},
                                   {3, 3, "u16", "", "", "none", "", true}}[static_cast<std::size_t>(kind)];
  Draws dice(seed, 7000 + static_cast<std::uint64_t>(kind));
  Layout layout;
  Sensor& sensor = layout.sensor;
  FrameFormat& f = sensor.frame;
  sensor.array = {.rows = odd.rows, .columns = odd.columns};
  f = {.kind = FrameKind::binary,
       .header = dice.of<std::string>({kind == 0 ? "" : "\xFE", "$", "\xAA\x55", "\xA5\x5A\xA5"}),
       .type = odd.type};
  f.big_endian = dice.chance(0.5), f.checksum = odd.checksum, f.trailer = odd.trailer;
  using Is = FrameField::Is;
  f.fields = {{Is::values, sensor.array.signals(), ""}};
  if (!odd.clock.empty()) {
    f.time = FrameTime{.type = odd.clock, .unit_s = 1e-3};
    f.fields.insert(f.fields.begin(), {Is::time, 0, ""});
  }
  if (!odd.counter.empty())
    f.fields.insert(dice.chance(0.5) ? f.fields.begin() : f.fields.end(),
                    {Is::counter, 0, dice.chance(0.5) ? odd.counter : "u16"});
  if (f.checksum == "none")
    f.fields.push_back({Is::skip, 2, ""}), layout.sum = dice.chance(0.5) ? "fletcher" : "crc";
  sensor.rate_hz = kind == 0 ? 12.5 : dice.of({12.5, 50.0, 100.0});
  send(layout, dice, true, odd.rests);
  return layout;
}

// The numbers of the sensor's frames, as its own description reads them.
std::vector<std::vector<float>> numbers_of(const Sensor& sensor, std::span<const Heard> heard) {
  std::vector<std::vector<float>> frames;
  const auto decoder = make_decoder(sensor);
  for (const Heard& chunk : heard)
    decoder->push(std::as_bytes(std::span(chunk.bytes)), [&](const DecodedFrame& frame) {
      frames.emplace_back(frame.values.begin(), frame.values.end());
      if (frame.time_s) frames.back().push_back(static_cast<float>(*frame.time_s));
    });
  return frames;
}

enum class Outcome { right, refused, wrong };
Outcome outcome_of(Layout& layout) {
  const ProbeReport report = probe(layout.heard, "here", {});
  for (const std::string& line : report.says) layout.says += line + "\n";
  if (!report.draft) return Outcome::refused;
  const Sensor& draft = *report.draft;
  const auto drafted = numbers_of(draft, layout.heard), sent = numbers_of(layout.sensor, layout.heard);
  // Up to two may be torn, or begin before the first that has a neighbour.
  const bool said = layout.says.find("assumed: its clock") != std::string::npos;
  bool same = drafted.size() + 3 > sent.size() && sent.size() + 3 > drafted.size();
  const std::size_t n = std::min(drafted.size(), sent.size());
  for (std::size_t k = 1; k + 2 < n && same; ++k) {
    auto a = drafted[drafted.size() - k], b = sent[sent.size() - k];
    if (said && a.size() == b.size()) a.pop_back(), b.pop_back();
    same = a == b;
  }
  // What the bytes do not tell is said.
  if (!same && layout.says.find("assumed: its numbers have no sign") != std::string::npos)
    return Outcome::refused;
  return same ? Outcome::right : Outcome::wrong;
}

/// How many layouts of so many seeds are drafted right; none may be wrong.
int right_of(std::uint64_t count, const std::function<Layout(std::uint64_t seed)>& layout_of) {
  const std::uint64_t from = number_of("SUPERTAC_FIRST_SEED", 1);
  int right = 0;
  for (std::uint64_t seed = from; seed < from + count; ++seed) {
    Layout layout = layout_of(seed);
    const Outcome outcome = outcome_of(layout);
    right += outcome == Outcome::right ? 1 : 0;
    EXPECT_NE(outcome, Outcome::wrong) << seed << json_of(layout.sensor).dump() << "\n" << layout.says;
  }
  return right;
}

TEST(ProbeBinary, DraftsLayoutsRightOrNot) {
  const auto count = static_cast<std::uint64_t>(mutations(24));
  int right = 0;
  for (const Family family : {Family::tuned, Family::second, Family::third})
    right += right_of(count, [=](std::uint64_t seed) { return layout_of(seed, family); });
  RecordProperty("right", right);
  EXPECT_GE(right, 0.85 * 3 * static_cast<double>(count));
}

/// Clocks of real seconds.
Layout dated_layout_of(std::uint64_t seed) {
  Draws dice(seed, 7777);
  Layout layout;
  Sensor& sensor = layout.sensor;
  FrameFormat& f = sensor.frame;
  sensor.array = {.rows = 4, .columns = dice.of({3, 4, 6, 8})};
  const std::size_t values = sensor.array.signals();
  sensor.rate_hz = dice.of({40.0, 100.0});
  f = {.kind = FrameKind::binary,
       .time = FrameTime{.type = "f64", .unit_s = 1},
       .header = dice.of<std::string>({"TACT", "\xAA\x55", "\x02\x25\x2A"}),
       .type = dice.of<std::string>({"u16", "i16", "f32"})};
  f.big_endian = dice.chance(0.5);
  const bool port = dice.chance(0.5);
  const double scale = f.type == "f32" ? 1e-3 : 1;
  std::vector<double> rest;
  for (std::size_t k = 0; k < values; ++k) rest.push_back(300 + 50 * dice.normal());
  for (int n = 0; n < 200; ++n) {
    std::vector<double> now;
    for (std::size_t k = 0; k < values; ++k) {
      const bool pressed = k / 2 == static_cast<std::size_t>(n) / 25 % (values / 2);
      const double felt = pressed ? 400 * std::sin(n % 25 / 25.0 * 3.14) : 0;
      now.push_back(scale * std::round(rest[k] + felt + 2 * dice.normal()));
    }
    if (port || layout.heard.empty()) layout.heard.push_back({100 + n / sensor.rate_hz, ""});
    layout.heard.back().bytes += sent_frame(sensor, now, 1.7e9 + 20 + n / sensor.rate_hz);
  }
  return layout;
}

TEST(ProbeBinary, ClocksOfRealSecondsAreFound) { EXPECT_GE(right_of(12, dated_layout_of), 10); }

// A sum that no sensor's file can say is no signal: the layout is refused. Of seeds from 13 on, two of which
// had a counter before a checksum drafted as a clock.
TEST(ProbeBinary, SumsAndCountersAreNoValues) {
  for (int kind = 0; kind < 4; ++kind) {
    const int right = right_of(static_cast<std::uint64_t>(mutations(4)),
                               [=](std::uint64_t seed) { return odd_layout_of(12 + seed, kind); });
    EXPECT_TRUE(kind == 0 || right == 0) << kind;
  }
}

/// Few taxels, most of which never move, before a byte that follows from all others.
Layout summed_layout_of(std::uint64_t seed, const std::string& sum) {
  Draws dice(seed, 7070);
  Layout layout;
  layout.sum = sum;
  Sensor& sensor = layout.sensor;
  FrameFormat& f = sensor.frame;
  sensor.array = {.rows = static_cast<int>(1 + dice.below(4)), .columns = 4};
  sensor.rate_hz = dice.of({20.0, 50.0, 100.0});
  f = {.kind = FrameKind::binary,
       .header = dice.of<std::string>({"\xFE", "\xAA\x55", "\xA5\x5A\xA5"}),
       .type = dice.of<std::string>({"u8", "u8", "u16"})};
  f.big_endian = dice.chance(0.5);
  using Is = FrameField::Is;
  f.fields = {{Is::values, sensor.array.signals(), ""}};
  if (dice.chance(0.3)) f.fields.insert(f.fields.begin(), {Is::counter, 0, "u8"});
  if (sum == "sum8" || sum == "xor8")
    f.checksum = sum, layout.sum.clear();
  else
    f.fields.push_back({Is::skip, 1, ""});
  if (dice.chance(0.3)) f.trailer = "\r\n";
  send(layout, dice, false, false, dice.of({0.5, 0.8}));
  return layout;
}

TEST(ProbeBinary, AByteThatFollowsFromAllOthersIsNoSignal) {
  const auto count = static_cast<std::uint64_t>(mutations(6));
  const std::initializer_list<const char*> sums = {
      "sum8", "xor8", "complement", "negated", "from a begin", "ones' complement", "crossed"};
  int right = 0;
  for (const char* sum : sums)
    right += right_of(count, [=](std::uint64_t seed) { return summed_layout_of(seed, sum); });
  RecordProperty("right", right);
  EXPECT_GE(right, 0.4 * static_cast<double>(sums.size() * count));  // the others rest, or say too little
}

std::string framed(const std::string& frame, const std::string& name) {
  std::string sent = name == "COBS" ? "" : name == "SLIP" ? "\xC0" : "\x7E", block;
  for (const char c : frame + std::string(1, '\0')) {
    const bool slip = name == "SLIP" && (c == '\xC0' || c == '\xDB'),
               hdlc = name == "HDLC" && (c == '\x7E' || c == '\x7D');
    if (name == "COBS" && c == '\0')
      sent += static_cast<char>(block.size() + 1) + block, block.clear();
    else if (name == "COBS")
      block += c;
    else if (slip)
      sent += c == '\xC0' ? "\xDB\xDC" : "\xDB\xDD";
    else
      sent += hdlc ? std::string{'\x7D', static_cast<char>(c ^ 0x20)} : std::string(1, c);
  }
  return sent + (name == "COBS" ? std::string(1, '\0') : sent.substr(0, 1));
}

TEST(ProbeBinary, FramingsAreRefusedByName) {
  for (const std::string name : {"SLIP", "HDLC", "COBS", "seven", "/touch", "values"})
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      Draws dice(seed, 5757);
      Layout layout{.sensor = {}, .heard = {{100, ""}}, .says = {}};
      std::vector<int> rest;
      for (std::size_t k = 0; k < 16; ++k) rest.push_back(static_cast<int>(100 + dice.below(900)));
      for (std::size_t n = 0; n < 250; ++n) {
        const bool word = name.size() == 6;  // as OSC and MessagePack have it, before numbers of two bytes
        std::string frame = word ? name + ",iiiiiiii" : name == "seven" ? "\xF0\x7D" : "\x02";
        for (std::size_t k = 0; k < 16; ++k) {
          const int v = rest[k] + (n / 25 % 16 == k ? 900 : 0) + static_cast<int>(3 * dice.normal());
          const int low = name == "seven" ? 7 : 8;
          frame += static_cast<char>(v >> low), frame += static_cast<char>(v & ((1 << low) - 1));
        }
        layout.heard[0].bytes += name == "seven" ? frame + "\xF7" : word ? frame : framed(frame, name);
      }
      if (name.size() == 6 && seed % 2 == 0) layout.heard[0].bytes.erase(layout.heard[0].bytes.size() / 3, 1);
      EXPECT_EQ(outcome_of(layout), Outcome::refused) << layout.says;
      EXPECT_NE(layout.says.find(name), std::string::npos) << layout.says;
    }
}

// After every lag, or every second, all of it returns: the periods of a stream are not its lags.
TEST(ProbeBinary, WhatNeverChangesIsNoSensor) {
  for (const std::string& again :
       {std::string(1, '\0'), std::string("\x01\x02"), std::string("\0\0\0\x01", 4)}) {
    Layout layout{.sensor = {}, .heard = {{100, ""}}, .says = {}};
    while (layout.heard[0].bytes.size() < 1 << 18) layout.heard[0].bytes += again;
    const std::string& bytes = layout.heard[0].bytes;
    const Bytes view(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    EXPECT_EQ(periods_of(view).size(), 1U);
    EXPECT_EQ(outcome_of(layout), Outcome::refused) << layout.says;
  }
}

TEST(ProbeBinary, BytesThatRestAtLettersAreNoWords) {
  Layout layout;
  layout.sensor.array = {.rows = 4, .columns = 4};
  layout.sensor.frame = {.kind = FrameKind::binary, .header = "\xAA\x55", .type = "u8"};
  layout.heard = {{100, ""}};
  for (std::size_t n = 0; n < 400; ++n) {
    layout.heard[0].bytes += "\xAA\x55";
    for (std::size_t k = 0; k < 16; ++k)
      layout.heard[0].bytes +=
          static_cast<char>(97 + k * 5 % 16 + (k % 5 == 2 && n / 40 % 4 == k / 4 ? n % 40 : 0));
  }
  outcome_of(layout);
  EXPECT_EQ(layout.says.find("words"), std::string::npos) << layout.says;
}

TEST(ProbeBinary, PrintableValuesAreNoText) {
  Layout layout;
  layout.sensor.array = {.rows = 12, .columns = 32};
  layout.sensor.frame = {.kind = FrameKind::binary, .header = "\xAA\x55", .type = "u8"};
  Draws dice(5, 7);
  std::vector<double> rest;
  for (std::size_t k = 0; k < 384; ++k) rest.push_back(40 + 70 * dice.random.uniform(900'000 + k));
  for (int n = 0; n < 100; ++n) {
    std::vector<double> now;
    for (const double r : rest) now.push_back(std::round(std::clamp(r + 2 * dice.normal(), 32.0, 126.0)));
    layout.heard.push_back({100 + n * 0.02, sent_frame(layout.sensor, now, n * 0.02)});
  }
  EXPECT_NE(outcome_of(layout), Outcome::wrong) << layout.says;
  EXPECT_NE(layout.says.find("header AA55, 384 values u8"), std::string::npos) << layout.says;
}

}  // namespace supertac::probe_binary_test
