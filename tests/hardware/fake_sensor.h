// A device that sends frames as a Sensor describes them, written down apart from the decoders.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>

#include "data/frames/binary_decoder.h"
#include "data/sensors/sensor.h"
#include "io/numbers/numbers.h"
#include "tests/support/draws.h"

namespace supertac {

inline void append_bytes(std::string& bytes, std::uint64_t bits, std::size_t count, bool big_endian) {
  for (std::size_t i = 0; i < count; ++i)
    bytes += static_cast<char>(bits >> 8 * (big_endian ? count - 1 - i : i));
}

inline std::uint64_t bits_of(double value, const std::string& type) {
  if (type == "f32") return std::bit_cast<std::uint32_t>(static_cast<float>(value));
  if (type == "f64") return std::bit_cast<std::uint64_t>(value);
  return static_cast<std::uint64_t>(std::llround(value));
}

/// How many mutations a test tries: few, or SUPERTAC_MUTATIONS, for a study.
inline int mutations(int quick) {
  return static_cast<int>(number_of("SUPERTAC_MUTATIONS", static_cast<std::uint64_t>(quick)));
}

/// One frame of so many values, in the order of the frame.
inline std::string sent_frame(const Sensor& sensor, std::span<const double> values, double time_s) {
  const FrameFormat& f = sensor.frame;
  const double exact = f.time ? time_s / f.time->unit_s : 0,
               stamp = f.time && f.time->type == "f64" ? exact : std::round(exact);
  std::string bytes;
  if (f.kind == FrameKind::text) {
    std::size_t next = 0;
    for (int column = 0; next < values.size() || (f.time && f.time->column == column); ++column) {
      const bool skipped = std::find(f.skip.begin(), f.skip.end(), column) != f.skip.end();
      if (column > 0) bytes += f.separator;
      bytes += skipped ? "x" : f.time && f.time->column == column ? format(stamp) : format(values[next++]);
    }
    return bytes + "\r\n";
  }
  if (f.kind == FrameKind::json) {
    std::string list;
    const auto columns = static_cast<std::size_t>(sensor.array.columns * sensor.array.channels);
    for (std::size_t i = 0; i < values.size(); ++i)
      list += (i == 0 ? "[" : i % columns == 0 ? "],[" : ",") + format(values[i]);
    list = "[" + list + "]]";
    if (f.values.empty()) return list + "\n";
    return (f.time ? "{\"" + f.time->key + "\":" + format(stamp) + "," : "{") + "\"" + f.values +
           "\":" + list + "}\n";
  }
  const auto width_of = [](const std::string& type) { return std::stoul(type.substr(1)) / 8; };
  std::vector<FrameField> fields = f.fields;
  if (fields.empty() && f.time) fields.push_back({FrameField::Is::time, 0, ""});
  if (f.fields.empty()) fields.push_back({FrameField::Is::values, values.size(), ""});
  std::size_t next = 0;
  bytes = f.header;
  for (const FrameField& field : fields) {
    if (field.is == FrameField::Is::time)
      append_bytes(bytes, bits_of(stamp, f.time->type), width_of(f.time->type), f.big_endian);
    if (field.is == FrameField::Is::counter)
      append_bytes(bytes, static_cast<std::uint64_t>(std::llround(time_s * sensor.rate_hz)),
                   width_of(field.type), f.big_endian);
    if (field.is == FrameField::Is::skip) bytes.append(field.count, '#');
    if (field.is == FrameField::Is::values)
      for (const std::size_t end = next + field.count; next < end; ++next)
        append_bytes(bytes, bits_of(values[next], f.type), width_of(f.type), f.big_endian);
  }
  const auto covered = std::as_bytes(std::span(bytes)).subspan(f.checksum_from.value_or(f.header.size()));
  append_bytes(bytes, checksum_of(f.checksum, covered), checksum_bytes(f.checksum),
               f.checksum_big_endian.value_or(f.big_endian));
  return bytes + f.trailer;
}

/// Counts from 0 to 1000 that rise under pressure.
inline Sensor mat(int rows, int columns, double rate_hz, const std::string& frame) {
  return sensor_of_json("{\"rows\":" + std::to_string(rows) + ",\"columns\":" + std::to_string(columns) +
                            ",\"rate_hz\":" + format(rate_hz) +
                            R"(,"pressed":"higher","range":[0,1000],"frame":)" + frame + "}",
                        "test");
}

}  // namespace supertac
