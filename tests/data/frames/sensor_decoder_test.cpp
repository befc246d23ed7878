#include "data/frames/sensor_decoder.h"

#include <random>

#include "data/frames/binary_decoder.h"
#include "tests/hardware/fake_sensor.h"
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
  const unsigned codes = sensor.frame.type == "u8" ? 256 : sensor.frame.type == "i8" ? 128 : 1000;
  std::vector<double> values;
  for (std::size_t i = 0; i < sensor.values(); ++i) values.push_back(random() % codes);
  return values;
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
    for (unsigned n = 0; n < 20; ++n) bytes += sent_frame(sensor, values_of(sensor, n), 0.01 * n);
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
      for (const char c : sent_frame(sensor, values, 0.01 * n))
        if (random() % 1000 == 0)
          whole = false;
        else
          bytes += c;
      if (whole) undamaged[{values.begin(), values.end()}] = 1;
    }
    const Decoded decoded = decode(sensor, bytes, 100);
    std::size_t found = 0;
    for (const auto& frame : decoded.frames) found += undamaged.contains(frame) ? 1 : 0;
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
      for (unsigned n = 0; n < 8; ++n) bytes += sent_frame(sensor, values_of(sensor, n), 0.01 * n);
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

}  // namespace supertac::sensor_decoder_test
