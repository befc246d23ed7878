#include "data/frames/sensor_decoder.h"

#include <random>

#include "data/frames/binary_decoder.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::sensor_decoder_test {

Sensor sensor_with(const std::string& array, const std::string& frame) {
  return sensor_of_json("{" + array + R"(,"pressed":"higher","range":[0,1000],"frame":)" + frame + "}",
                        "test");
}

// Every kind, with what can be left out left out somewhere.
std::map<std::string, Sensor> sensors() {
  const std::string mat = R"("rows":4,"columns":5)", skin = R"("rows":4,"columns":4,"channels":3)";
  return {
      {"board", Sensor{}},
      {"commas", sensor_with(mat, R"({"kind":"text"})")},
      {"blanks",
       sensor_with(mat, R"({"kind":"text","separator":" ","skip":[1,3],"time":{"column":0,"unit":"ms"}})")},
      {"tabs", sensor_with(mat, R"({"kind":"text","separator":"\t","time":{"column":20,"unit":"s"}})")},
      {"list", sensor_with(mat, R"({"kind":"json"})")},
      {"object", sensor_with(skin, R"({"kind":"json","values":"b","time":{"key":"t","unit":"us"}})")},
      {"header", sensor_with(skin, R"({"kind":"binary","header":"AA55","type":"i16"})")},
      {"trailer", sensor_with(mat, R"({"kind":"binary","trailer":"0D0A7E","type":"f32","endian":"big"})")},
      {"sum", sensor_with(mat, R"({"kind":"binary","header":"FF","type":"u8","checksum":"sum8"})")},
      {"crc",
       sensor_with(mat,
                   R"({"kind":"binary","header":"24","type":"u32","checksum":"crc16-modbus","trailer":"21",
        "time":{"type":"u32","unit":"ms"}})")},
      {"modbus", sensor_with(mat, R"({"kind":"binary","header":"010328","type":"u16","endian":"big",
        "checksum":{"kind":"crc16-modbus","from":0,"endian":"little"}})")},
      {"wide", sensor_with(mat, R"({"kind":"binary","header":"AA55","type":"i32","checksum":"crc32",
        "fields":[{"counter":"u16"},{"values":12},{"skip":3},{"values":8},"time"],
        "time":{"type":"u32","unit":"us"}})")},
      {"crc8", sensor_with(mat, R"({"kind":"binary","header":"AA55","type":"i8","checksum":"crc8"})")},
      {"sum16", sensor_with(mat, R"({"kind":"binary","header":"A5","type":"u16",
        "fields":[{"values":20},{"counter":"u8"}],"checksum":{"kind":"sum16","from":0,"endian":"big"}})")},
      {"ccitt", sensor_with(mat, R"({"kind":"binary","header":"2424","type":"u16","checksum":"crc16-ccitt",
        "endian":"big","time":{"type":"u16","unit":"ms"}})")}};
}

std::vector<double> values_of(const Sensor& sensor, unsigned frame) {
  std::mt19937 random(frame);
  const FrameFormat& f = sensor.frame;
  const unsigned codes = f.type == "u8" ? 256 : f.type == "i8" ? 128 : 1000;
  const float unit = f.kind == FrameKind::board ? static_cast<float>(rig::volts_of(1)) : 1;
  std::vector<double> values;
  for (std::size_t i = 0; i < sensor.values(); ++i)
    values.push_back(double{static_cast<float>(random() % codes) * unit});
  return values;
}

std::string sent(const Sensor& sensor, std::span<const double> values, double time_s = 0) {
  if (sensor.frame.kind != FrameKind::board) return sent_frame(sensor, values, time_s);
  BoardFrame frame = random_frame(1);
  for (std::size_t k = 0; k < values.size(); ++k)
    frame.samples[rig::kPatches * k] = static_cast<std::uint16_t>(rig::adc_of(values[k]));
  return as_text(frame_bytes(frame));
}

struct Decoded {
  std::vector<std::vector<float>> frames;
  std::vector<std::optional<double>> times;
  SensorDecoder::Counters counters;
};

Decoded decode(const Sensor& sensor, const std::string& bytes, std::size_t piece) {
  const auto decoder = make_decoder(sensor);
  Decoded decoded;
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    decoder->push(std::as_bytes(std::span(bytes)).subspan(at, std::min(piece, bytes.size() - at)),
                  [&](const DecodedFrame& frame) {
                    decoded.frames.emplace_back(frame.values.begin(), frame.values.end());
                    decoded.times.push_back(frame.time_s);
                  });
  decoded.counters = decoder->counters();
  return decoded;
}

TEST(SensorDecoder, ReadsEveryKindInPiecesOfAnySize) {
  for (const auto& [name, sensor] : sensors()) {
    SCOPED_TRACE(name);
    std::string bytes;
    for (unsigned n = 0; n < 20; ++n) bytes += sent(sensor, values_of(sensor, n), 0.01 * n);
    for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{100'000}}) {
      const Decoded decoded = decode(sensor, bytes, piece);
      ASSERT_EQ(decoded.frames.size(), 20U);
      EXPECT_EQ(decoded.counters.torn, 0U);
      EXPECT_EQ(decoded.counters.bytes, bytes.size());
      for (unsigned n = 0; n < 20; ++n) {
        const std::vector<double> sent = values_of(sensor, n);
        EXPECT_EQ(decoded.frames[n], std::vector<float>(sent.begin(), sent.end()));
        ASSERT_EQ(decoded.times[n].has_value(), sensor.frame.time.has_value());
        const double unit_s = sensor.frame.time ? sensor.frame.time->unit_s : 0;
        EXPECT_NEAR(decoded.times[n].value_or(0.01 * n), 0.01 * n, 0.51 * unit_s + 1e-9);
      }
    }
  }
}

// Every frame none of whose bytes was lost, at a thousandth of them lost.
TEST(SensorDecoder, FindsTheUndamagedFramesAgain) {
  for (const auto& [name, sensor] : sensors()) {
    std::mt19937 random(3);
    std::string bytes;
    std::map<std::vector<float>, int> undamaged;
    for (unsigned n = 0; n < 3000; ++n) {
      const std::vector<double> values = values_of(sensor, n);
      bool whole = true;
      for (const char c : sent(sensor, values, 0.01 * n))
        if (random() % 1000 == 0)
          whole = false;
        else
          bytes += c;
      if (whole) undamaged[{values.begin(), values.end()}] = 1;
    }
    const Decoded decoded = decode(sensor, bytes, 100);
    std::size_t found = 0;
    for (const auto& frame : decoded.frames) found += undamaged.contains(frame) ? 1 : 0;
    const bool exact = found == undamaged.size() && found == decoded.frames.size();
    EXPECT_TRUE(name != "board" || exact) << found;
    EXPECT_GE(static_cast<double>(found), 0.99 * static_cast<double>(undamaged.size())) << name;
    EXPECT_LT(undamaged.size(), 2990U) << name;
    EXPECT_GT(decoded.counters.torn, 0U) << name;
  }
}

TEST(SensorDecoder, AHeaderInTheValuesOfARestingSensorIsNoFrame) {
  const Sensor sensor = sensors().at("sum");
  std::vector<double> values(20, 255);  // as the header
  std::string bytes;
  for (int n = 0; n < 50; ++n) bytes += sent_frame(sensor, values, 0);
  const Decoded decoded = decode(sensor, bytes.substr(5), 64);
  EXPECT_GE(decoded.frames.size(), 48U);
  for (const auto& frame : decoded.frames) EXPECT_EQ(frame, std::vector<float>(20, 255));
}

// Two taxels that read AA 55 as the header does, for 5 frames of 15 at rest of the time; one begins to listen
// within a frame. Nothing is lost, and where bytes are, only what was torn.
TEST(SensorDecoder, ValuesThatReadAsTheHeaderCostNoFrame) {
  const Sensor sensor =
      sensor_with(R"("rows":12,"columns":32)", R"({"kind":"binary","header":"AA55","type":"u8"})");
  std::mt19937 random(8);
  std::string bytes;
  std::vector<std::vector<float>> sent;
  for (unsigned n = 0; n < 10'000; ++n) {
    std::vector<double> values = values_of(sensor, n);
    if (n % 15 < 5) values[100] = 0xAA, values[101] = 0x55;
    for (const std::size_t place : {0U, 383U}) values[place] = n % 100 < 50 ? 0xAA : 0x55;
    bytes += sent_frame(sensor, values, 0);
    sent.emplace_back(values.begin(), values.end());
  }
  EXPECT_EQ(decode(sensor, bytes, 997).frames, sent);
  const Decoded late = decode(sensor, bytes.substr(50), 997);  // what came first began within a frame
  EXPECT_EQ(late.frames, std::vector(sent.begin() + 1, sent.end()));
  std::string torn;
  for (std::size_t n = 0; n < sent.size(); ++n) torn += bytes.substr(386 * n, n % 100 == 57 ? 380 : 386);
  const Decoded found = decode(sensor, torn, 997);
  std::size_t right = 0, at = 0;
  for (const auto& frame : found.frames) {
    const auto place = std::find(sent.begin() + static_cast<std::ptrdiff_t>(at), sent.end(), frame);
    if (place != sent.end()) ++right, at = static_cast<std::size_t>(place - sent.begin());
  }
  EXPECT_EQ(right, 9'900U);
  EXPECT_LE(found.frames.size(), 10'000U);
}

TEST(SensorDecoder, ChecksumsAreThoseOfTheirStandards) {
  const std::string text = "123456789";  // the check values of the catalogues of CRCs
  for (const auto& [kind, sum] : {std::pair("crc8", 0xF4U),
                                  {"crc16-modbus", 0x4B37U},
                                  {"crc16-ccitt", 0x29B1U},
                                  {"crc16-xmodem", 0x31C3U},
                                  {"crc32", 0xCBF43926U},
                                  {"sum8", 0xDDU},
                                  {"sum16", 0x1DDU},
                                  {"xor8", 0x31U}})
    EXPECT_EQ(checksum_of(kind, std::as_bytes(std::span(text))), sum) << kind;
}

TEST(SensorDecoder, MutatedStreamsGiveFramesOrNone) {
  std::mt19937 random(5);
  for (const auto& [name, sensor] : sensors()) {
    for (int run = mutations(400) / 10; run > 0; --run) {
      std::string bytes;
      for (unsigned n = 0; n < 8; ++n) bytes += sent(sensor, values_of(sensor, n), 0.01 * n);
      for (unsigned change = 0; change < 1 + random() % 20; ++change) {
        const std::size_t at = random() % bytes.size();
        switch (random() % 4) {
          case 0:
            bytes.erase(at, random() % 9);
            break;
          case 1:
            bytes.insert(at, bytes.substr(random() % bytes.size(), random() % 30));
            break;
          case 2:
            bytes[at] = static_cast<char>(random());
            break;
          default:
            bytes.insert(at, random() % 9000, static_cast<char>(random()));
        }
      }
      const Decoded decoded = decode(sensor, bytes, 1 + random() % 500);
      EXPECT_EQ(decoded.counters.frames, decoded.frames.size());
      EXPECT_LE(decoded.counters.discarded_bytes, bytes.size());
      for (const auto& frame : decoded.frames) EXPECT_EQ(frame.size(), sensor.values()) << name;
    }
  }
}

TEST(BoardFrame, LayoutIsThatOfTheBoard) {
  BoardFrame frame;
  frame.samples[0] = 0x0ABC;      // patch 0, row 0, column 0: taxel 0
  frame.samples[5 * 6] = 0x0123;  // column 1, row 2: taxel 6
  frame.slip = 0x0FED;
  const auto bytes = frame_bytes(frame);
  EXPECT_EQ(bytes.size(), 164U);
  EXPECT_EQ(bytes[0], std::byte{0x24});
  EXPECT_EQ(bytes[1], std::byte{0x0A});
  EXPECT_EQ(bytes[2], std::byte{0xBC});
  EXPECT_EQ(bytes[161], std::byte{0x0F});
  EXPECT_EQ(bytes[162], std::byte{0xED});
  EXPECT_EQ(bytes[163], std::byte{0x21});
  EXPECT_EQ(frame.taxel(6), 0x0123);
  BoardDecoder decoder;
  decoder.push(bytes, [](const DecodedFrame& found) { EXPECT_EQ(found.values[6], 0x0123 * (3.3F / 4096)); });
  EXPECT_EQ(decoder.frame(), frame);
  frame.slip = 4096;
  EXPECT_REFUSAL("write_frame: sample expects 0 to 4095, got 4096", frame_bytes(frame));
}

TEST(BoardFrame, EveryHighByteIsChecked) {
  for (std::size_t at = 1; at <= 161; at += 2) {
    auto bytes = frame_bytes(random_frame(1));
    bytes[at] |= std::byte{0x10};
    BoardDecoder decoder;
    decoder.push(bytes, [&](const DecodedFrame&) { ADD_FAILURE() << "high byte at " << at; });
  }
}

TEST(BoardDecoder, DiscardedBytesAreFramesUpToAFewOfACable) {
  for (const auto& [bytes, frames] :
       {std::pair(0U, 0U), {1U, 0U}, {80U, 1U}, {163U, 1U}, {164U, 1U}, {165U, 1U}, {327U, 2U}}) {
    BoardDecoder decoder;
    std::vector<std::byte> stream(bytes);
    const std::vector<std::byte> frame = frame_bytes(random_frame(1));
    stream.insert(stream.end(), frame.begin(), frame.end());
    std::vector<std::uint32_t> damaged;
    decoder.push(stream, [&](const DecodedFrame& found) { damaged.push_back(found.damaged); });
    EXPECT_EQ(damaged, std::vector{frames}) << bytes;
  }
}

TEST(BoardDecoder, FlagsAFlippedHighBitOnceAndAcceptsALastingChange) {
  BoardDecoder decoder;
  const auto jump = [&](const BoardFrame& frame) {
    bool jumps = false;
    decoder.push(frame_bytes(frame), [&](const DecodedFrame& found) { jumps = found.jump; });
    return jumps;
  };
  BoardFrame frame;
  frame.samples.fill(3000);
  EXPECT_FALSE(jump(frame));
  BoardFrame flipped = frame;
  flipped.samples[10] ^= 0x400;
  EXPECT_TRUE(jump(flipped));
  EXPECT_FALSE(jump(frame));
  frame.samples[5] = 2000;
  int flagged = 0;
  for (int i = 0; i < 10; ++i) flagged += jump(frame) ? 1 : 0;
  EXPECT_EQ(flagged, 3);
}

// A thousandth of the bytes is lost, another is put between others.
TEST(BoardDecoder, AcceptsHardlyAnyWrongFrameUnderMixedFaults) {
  Dice dice(3, 3);
  std::vector<std::byte> bytes;
  std::vector<BoardFrame> sent;
  std::size_t intact = 0, next = 0, accepted = 0, wrong = 0;
  for (std::size_t i = 0; i < 20'000; ++i) {
    sent.push_back(random_frame(i));
    bool touched = false;
    for (const std::byte byte : frame_bytes(sent[i])) {
      const bool lost = dice.hit(1e-3), more = !lost && dice.hit(1e-3);
      if (!lost) bytes.push_back(byte);
      if (more) bytes.push_back(static_cast<std::byte>(dice.below(256)));
      touched = touched || lost || more;
    }
    intact += touched ? 0 : 1;
  }
  BoardDecoder decoder;
  decoder.push(bytes, [&](const DecodedFrame&) {
    const auto from = sent.begin() + static_cast<std::ptrdiff_t>(next);
    const auto end = sent.begin() + static_cast<std::ptrdiff_t>(std::min(next + 50, sent.size()));
    const auto at = std::find(from, end, decoder.frame());
    if (at != end) next = static_cast<std::size_t>(at - sent.begin()) + 1;
    ++accepted, wrong += at == end ? 1 : 0;
  });
  RecordProperty("wrong", static_cast<int>(wrong));
  EXPECT_LE(static_cast<double>(wrong), 1e-3 * static_cast<double>(accepted));
  EXPECT_GE(accepted, intact);
  EXPECT_LT(intact, 18'000U) << "the faults were not injected";
}

}  // namespace supertac::sensor_decoder_test
