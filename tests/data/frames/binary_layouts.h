// A binary layout of a test, and bytes as its sensor sends them.
#pragma once

#include "data/frames/probe.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/draws.h"

namespace supertac::probe_binary_test {

/// What was heard of a sensor that sends binary frames.
struct Layout {
  Sensor sensor;
  std::vector<Heard> heard;
  std::string says;
  std::string sum = {};  ///< which sum that no sensor's file can say stands at the frame's end
};

/// Of two bytes Fletcher's, or a CRC that begins otherwise than those that are known; else of one.
inline std::uint32_t foreign_sum(std::string_view bytes, const std::string& form) {
  std::uint32_t a = 0, b = 0, crc = 0x1D0F, sum = 0, crossed = 0;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    sum += byte, crossed ^= byte;
    a = (a + byte) % 255, b = (b + a) % 255, crc ^= std::uint32_t{byte} << 8;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1 ^ ((crc & 0x8000) != 0 ? 0x1021U : 0U)) & 0xFFFF;
  }
  if (form == "fletcher") return b << 8 | a;
  if (form == "complement") return ~sum & 0xFF;
  if (form == "negated") return -sum & 0xFF;
  if (form == "from a begin") return (sum + 0x5A) & 0xFF;
  if (form == "ones' complement") return 255 - a;
  if (form == "crossed") return ~crossed & 0xFF;
  return crc;
}

inline std::string random_bytes(Draws& dice, std::size_t count) {
  std::string bytes;
  while (bytes.size() < count) bytes += static_cast<char>(1 + dice.below(255));
  return bytes;
}

// What the layout's sensor sends, into `heard`.
inline void send(Layout& layout, Draws& dice, bool third, bool rests = false, double still = 0.1) {
  const Sensor& sensor = layout.sensor;
  const FrameFormat& f = sensor.frame;
  const std::size_t values = sensor.array.signals();
  const bool port = dice.chance(0.5);
  const double noise = third ? dice.of({0.7, 2.0, 8.0, 60.0}) : dice.of({0.4, 1.0, 3.0, 20.0, 200.0});
  const double top = f.type.ends_with("8") ? (f.type == "i8" ? 60 : 120)
                     : f.type == "f32"     ? 3
                                           : dice.of({250.0, 1000.0, 4000.0});
  const double scale = f.type == "f32" ? (dice.chance(0.3) ? 1 : 3e-3) : 1;
  const double loud = f.type.ends_with("8") ? std::min(noise, 3.0) : std::min(noise, 0.1 * top / scale);
  std::vector<double> rest, quiet;
  const bool spread = dice.chance(0.7);
  for (std::size_t k = 0; k < values; ++k)
    rest.push_back((f.type.front() == 'i' ? -0.3 * top : 0.1 * top) +
                   (spread ? 0.6 * top * dice.random.uniform(900'000 + k) : 0.1 * top)),
        quiet.push_back(dice.chance(still) ? 0 : 1);
  const bool resting = dice.chance(0.25) || rests,
             header_in_payload = dice.chance(0.2) && f.type == "u8" && f.header.size() > 1;
  const double seconds = std::clamp(100'000.0 / (static_cast<double>(values) * sensor.rate_hz * 2), 2.0, 5.0);
  const int frames = static_cast<int>(seconds * sensor.rate_hz);
  const double begin = 5 + 100 * dice.random.uniform(1'000'001);
  std::string bytes;
  if (dice.chance(0.25))
    bytes = "ets Jun  8 2016 00:22:57\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\nSensor ready\r\n";
  if (!bytes.empty() && port) layout.heard.push_back({100, bytes});
  const std::size_t cut = dice.chance(0.5) && bytes.empty() ? dice.below(40) : 0;
  for (int n = 0; n < frames; ++n) {
    std::vector<double> now;
    for (std::size_t k = 0; k < values; ++k) {
      const double at = n / sensor.rate_hz * 1.3,
                   press = resting || static_cast<std::size_t>(std::floor(at) * 7) % values > k ||
                                   k > static_cast<std::size_t>(std::floor(at) * 7) % values + 4
                               ? 0
                               : std::max(0.0, std::sin(at * 6.2832 / 2));
      double x = rest[k] + quiet[k] * (0.35 * top * press + scale * loud * dice.normal());
      if (f.type != "f32" || scale == 1) x = std::round(x);
      if (f.type.front() == 'u') x = std::max(x, 0.0);
      if (f.type == "u8") x = std::min(x, 255.0);
      if (f.type == "i8") x = std::clamp(x, -128.0, 127.0);
      now.push_back(x);
    }
    if (header_in_payload && n % 3 == 0)
      for (int i = 0; i < 2; ++i)
        now[static_cast<std::size_t>(i)] = static_cast<unsigned char>(f.header[static_cast<std::size_t>(i)]);
    const double jitter = f.time && f.time->unit_s == 1e-6 ? 2e-5 * dice.normal() : 0;
    std::string sent = sent_frame(sensor, now, begin + n / sensor.rate_hz + jitter);
    if (!layout.sum.empty()) {
      sent.resize(sent.size() - f.fields.back().count - f.trailer.size());
      append_bytes(sent, foreign_sum(std::string_view(sent).substr(f.header.size()), layout.sum),
                   f.fields.back().count, f.big_endian);
      sent += f.trailer;
    }
    bytes += sent;
    if (port)
      layout.heard.push_back(
          {100.1 + n / sensor.rate_hz, n == 0 ? sent.substr(std::min(cut, sent.size() - 1)) : sent});
  }
  if (!port) layout.heard = {{100, bytes.substr(cut)}};
}

}  // namespace supertac::probe_binary_test
