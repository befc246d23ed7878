// A Sensor as JSON.
#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "data/sensors/sensor.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::pair<const char*, FrameKind> kKinds[] = {{"board", FrameKind::board},
                                                        {"text", FrameKind::text},
                                                        {"json", FrameKind::json},
                                                        {"binary", FrameKind::binary}};
constexpr std::pair<const char*, double> kUnits[] = {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};

// So that 2.09 and 2.45 are 0.36 apart, as they are for a reader.
double rounded(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 12).ptr;
  return parse_double({text, end}).value_or(value);
}

SignalScale take_scale(JsonObject& keys) {
  SignalScale scale;
  scale.unit = keys.text("unit", scale.unit);
  constexpr std::pair<const char*, bool> kPolarities[] = {{"higher", true}, {"lower", false}};
  const bool rises = keys.one_of("pressed", kPolarities, "lower");
  if (const Json* range = keys.find("range")) {
    if (!range->is_array() || range->size() != 2 || !range->at(0).is_number() || !range->at(1).is_number())
      keys.wrong("range", "[low, high], the lower first", *range);
    const double low = range->at(0), high = range->at(1);
    if (!(low < high)) keys.wrong("range", "[low, high], the lower first", *range);
    scale.rest = rises ? low : high;
    scale.span = rounded(rises ? low - high : high - low);
  } else if (rises) {
    throw FileError(keys.where(), "has no \"range\": expected [rest, pressed hard] of a signal that rises");
  }
  return scale;
}

std::string bytes_of_hex(JsonObject& keys, const char* name) {
  const std::string hex = keys.text(name, "");
  std::string bytes;
  for (std::size_t at = 0; at < hex.size(); at += 2) {
    unsigned value = 0;
    const auto read = std::from_chars(&hex[at], hex.data() + std::min(at + 2, hex.size()), value, 16);
    if (read.ptr != &hex[at] + 2)
      keys.wrong(name, "bytes as hexadecimal digits, such as \"AA55\"", Json(hex));
    bytes += static_cast<char>(value);
  }
  return bytes;
}

FrameTime time_of(const Json& json, FrameKind kind, const std::string& where) {
  JsonObject keys(json, where, "frame.time.");
  FrameTime time;
  if (kind == FrameKind::text) time.column = keys.integer("column", 0);
  if (kind == FrameKind::json) time.key = keys.text("key", "time");
  if (kind == FrameKind::binary) time.type = keys.text("type", "u32");
  time.unit_s = keys.one_of("unit", kUnits, "s");
  keys.no_others();
  return time;
}

constexpr std::pair<const char*, bool> kEndian[] = {{"little", false}, {"big", true}};

// "crc16-modbus", or {"kind": "crc16-modbus", "from": 0, "endian": "little"}.
void take_checksum(JsonObject& keys, FrameFormat& f) {
  const Json* json = keys.find("checksum");
  if (json == nullptr) return;
  if (json->is_string()) {
    f.checksum = json->get<std::string>();
    return;
  }
  JsonObject inner(*json, keys.where(), "frame.checksum.");
  f.checksum = inner.text("kind");
  if (inner.find("from") != nullptr)
    f.checksum_from = static_cast<std::size_t>(std::max(inner.integer("from"), 0));
  if (inner.find("endian") != nullptr) f.checksum_big_endian = inner.one_of("endian", kEndian);
  inner.no_others();
}

// ["time", {"counter": "u8"}, {"values": 16}, {"skip": 4}]
std::vector<FrameField> fields_of(JsonObject& keys, const Json& json) {
  const char* expected =
      "a list of \"time\", {\"values\": N}, {\"skip\": BYTES} and {\"counter\": \"u8\"}, in turn";
  std::vector<FrameField> fields;
  if (!json.is_array() || json.empty()) keys.wrong("fields", expected, json);
  for (const Json& entry : json) {
    FrameField& field = fields.emplace_back();
    if (entry == "time") {
      field.is = FrameField::Is::time;
      continue;
    }
    JsonObject inner(entry.is_object() && entry.size() == 1 ? entry : Json::object(), keys.where(),
                     "frame.fields.");
    if (inner.find("counter") != nullptr) {
      field.is = FrameField::Is::counter, field.type = inner.text("counter");
    } else if (inner.find("skip") != nullptr || inner.find("values") != nullptr) {
      const bool skip = inner.find("skip") != nullptr;
      const int count = inner.integer(skip ? "skip" : "values");
      if (count < 1) keys.wrong("fields", expected, entry);
      field.is = skip ? FrameField::Is::skip : FrameField::Is::values;
      field.count = static_cast<std::size_t>(count);
    } else {
      keys.wrong("fields", expected, entry);
    }
    inner.no_others();
  }
  return fields;
}

Json json_of(const FrameField& field) {
  if (field.is == FrameField::Is::time) return "time";
  if (field.is == FrameField::Is::counter) return {{"counter", field.type}};
  return {{field.is == FrameField::Is::skip ? "skip" : "values", field.count}};
}

FrameFormat format_of(const Json& json, const std::string& where) {
  JsonObject keys(json, where, "frame.");
  FrameFormat f;
  f.kind = keys.one_of("kind", kKinds, "");
  if (const Json* time = f.kind == FrameKind::board ? nullptr : keys.find("time"))
    f.time = time_of(*time, f.kind, where);
  if (f.kind == FrameKind::text) {
    const std::string separator = keys.text("separator", ",");
    if (separator.size() != 1 && separator != "any")
      keys.wrong("separator", "one character", Json(separator));
    f.separator = separator == "any" ? '\0' : separator.front();
    constexpr std::pair<const char*, char> kDecimals[] = {{".", '.'}, {",", ','}};
    f.decimal = keys.one_of("decimal", kDecimals, ".");
    f.lines_per_frame = keys.integer("lines_per_frame", 1);
    f.prefix = keys.text("prefix", "");
    f.checksum = keys.text("checksum", f.checksum);
  }
  if (f.kind == FrameKind::text || f.kind == FrameKind::json) f.skip = keys.integers("skip");
  if (f.kind == FrameKind::json) f.values = keys.text("values", "");
  if (f.kind == FrameKind::binary) {
    f.header = bytes_of_hex(keys, "header");
    f.trailer = bytes_of_hex(keys, "trailer");
    f.big_endian = keys.one_of("endian", kEndian, "little");
    f.type = keys.text("type", f.type);
    take_checksum(keys, f);
    if (const Json* fields = keys.find("fields")) f.fields = fields_of(keys, *fields);
  }
  keys.no_others();
  return f;
}

std::vector<float> floats_of(JsonObject& keys, const char* name) {
  const std::vector<double> list = keys.numbers(name);
  return {list.begin(), list.end()};
}

std::vector<int> take_order(JsonObject& keys, const char* key, const TaxelArray& array) {
  const Json* value = keys.find(key);
  if (value == nullptr || *value == "row-major") return {};
  if (value->is_array()) return keys.integers(key);
  if (*value != "column-major") keys.wrong(key, "row-major, column-major, or a list of places", *value);
  std::vector<int> order;
  for (int k = 0; k < array.taxels(); ++k)
    order.push_back(k % array.columns * array.rows + k / array.columns);
  return order;
}

// The board is the rig's, and so is what it sits in.
Body usual_body(const Sensor& sensor) {
  return sensor.frame.kind == FrameKind::board ? Body::of_rig() : Body{};
}

TaxelArray take_array(JsonObject& keys) {
  TaxelArray array;
  array.rows = keys.integer("rows", array.rows);
  array.columns = keys.integer("columns", array.columns);
  array.channels = keys.integer("channels", 1);
  array.pitch_mm = pitch_of(keys, array.pitch_mm);
  array.check();
  return array;
}

Json json_of(const FrameFormat& f) {
  Json json;
  for (const auto& [word, kind] : kKinds)
    if (kind == f.kind) json["kind"] = word;
  const bool text = f.kind == FrameKind::text, object = f.kind == FrameKind::json;
  if (text) {
    json["separator"] = f.separator == 0 ? "any" : std::string(1, f.separator);
    if (f.decimal != '.') json["decimal"] = std::string(1, f.decimal);
    if (f.lines_per_frame != 1) json["lines_per_frame"] = f.lines_per_frame;
    if (!f.prefix.empty()) json["prefix"] = f.prefix;
    if (f.checksum != "none") json["checksum"] = f.checksum;
  }
  if ((text || object) && !f.skip.empty()) json["skip"] = f.skip;
  if (object && !f.values.empty()) json["values"] = f.values;
  if (f.kind == FrameKind::binary) {
    if (!f.header.empty()) json["header"] = hex_of_bytes(f.header);
    json["endian"] = f.big_endian ? "big" : "little";
    json["type"] = f.type;
    for (const FrameField& field : f.fields) json["fields"].push_back(json_of(field));
    if (f.checksum != "none") json["checksum"] = f.checksum;
    if (f.checksum_from || f.checksum_big_endian) {
      json["checksum"] = {{"kind", f.checksum}};
      if (f.checksum_from) json["checksum"]["from"] = *f.checksum_from;
      if (f.checksum_big_endian) json["checksum"]["endian"] = *f.checksum_big_endian ? "big" : "little";
    }
    if (!f.trailer.empty()) json["trailer"] = hex_of_bytes(f.trailer);
  }
  if (!f.time) return json;
  Json time;
  if (text) time["column"] = f.time->column;
  if (object) time["key"] = f.time->key;
  if (f.kind == FrameKind::binary) time["type"] = f.time->type;
  for (const auto& [word, unit_s] : kUnits)
    if (unit_s == f.time->unit_s) time["unit"] = word;
  json["time"] = time;
  return json;
}

}  // namespace

std::string hex_of_bytes(const std::string& bytes) {
  std::string hex;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    for (const int nibble : {byte >> 4, byte & 15}) hex += "0123456789ABCDEF"[nibble];
  }
  return hex;
}

Json json_of(const SignalScale& scale) {
  return {{"unit", scale.unit},
          {"pressed", scale.rises() ? "higher" : "lower"},
          {"range", {rounded(scale.low()), rounded(scale.high())}}};
}

SignalScale scale_of(JsonObject keys) {
  Sensor sensor;
  sensor.scale = take_scale(keys);
  keys.no_others();
  try {
    sensor.check();
  } catch (const std::invalid_argument& error) {
    throw FileError(keys.where(), error.what());
  }
  return sensor.scale;
}

double unit_of_time(const std::string& name) {
  for (const auto& [unit, seconds] : kUnits)
    if (name == unit) return seconds;
  throw std::invalid_argument("time is in " + in_quotes(name) + ", expected s, ms, us or ns");
}

Sensor sensor_of_json(const std::string& text, const std::string& where) {
  try {
    JsonObject keys(parse_json_limited(text), where);
    Sensor sensor;
    sensor.name = keys.text("name", "sensor");
    sensor.array = take_array(keys);
    sensor.scale = take_scale(keys);
    sensor.rate_hz = keys.number("rate_hz", 100);
    sensor.port = keys.text("port", "-");
    const Json* frame = keys.find("frame");
    if (frame == nullptr)
      throw FileError(where,
                      "has no \"frame\", such as {\"kind\": \"text\"}; supertac-stream --probe finds it");
    sensor.frame = format_of(*frame, where);
    const Json* body = keys.find("body");
    sensor.body = body != nullptr ? body_of({*body, where, "body."}) : usual_body(sensor);
    std::vector<int> order = take_order(keys, "order", sensor.array);
    sensor.dead = keys.integers("dead");
    sensor.rest = floats_of(keys, "rest");
    sensor.gain = floats_of(keys, "gain");
    sensor.follow_rest_s = keys.number("follow_rest_s", 0);
    const bool listed = keys.find("rest_order") != nullptr;
    sensor.order = listed ? take_order(keys, "rest_order", sensor.array) : order;
    keys.no_others();
    sensor.check();
    if (listed) sensor.reorder(std::move(order));
    sensor.check();
    return sensor;
  } catch (const JsonError& error) {
    throw FileError(where, error.what());
  } catch (const std::invalid_argument& error) {
    throw FileError(where, error.what());
  }
}

Sensor read_sensor(const std::string& name_or_path) {
  const Sensor rig;
  if (name_or_path == rig.name) return rig;
  return sensor_of_json(read_text_file(name_or_path, JsonLimits().max_bytes), name_or_path);
}

Json json_of(const Pitch& pitch) { return pitch.x == pitch.y ? Json(pitch.x) : Json{pitch.x, pitch.y}; }

Pitch pitch_of(JsonObject& keys, std::optional<Pitch> fallback) {
  const Json* json = keys.find("pitch_mm", !fallback);
  if (json == nullptr) return *fallback;
  if (json->is_number()) return json->get<double>();
  if (json->is_array() && json->size() == 2 && json->at(0).is_number() && json->at(1).is_number())
    return {json->at(0).get<double>(), json->at(1).get<double>()};
  keys.wrong("pitch_mm", "a number, or [along a row, from row to row]", *json);
}

Json json_of(const Sensor& sensor) {
  const TaxelArray& array = sensor.array;
  Json json = {{"name", sensor.name},
               {"rows", array.rows},
               {"columns", array.columns},
               {"pitch_mm", json_of(array.pitch_mm)},
               {"channels", array.channels}};
  json.update(json_of(sensor.scale));
  json["rate_hz"] = sensor.rate_hz;
  json["port"] = sensor.port;
  json["frame"] = json_of(sensor.frame);
  if (!sensor.order.empty()) json["order"] = sensor.order;
  if (!sensor.dead.empty()) json["dead"] = sensor.dead;
  for (const float rest : sensor.rest) json["rest"].push_back(rounded(double{rest}));
  for (const float gain : sensor.gain) json["gain"].push_back(rounded(double{gain}));
  if (!sensor.dead.empty() || !sensor.rest.empty() || !sensor.gain.empty())
    json["rest_order"] = sensor.order.empty() ? Json("row-major") : Json(sensor.order);
  if (sensor.follow_rest_s > 0) json["follow_rest_s"] = sensor.follow_rest_s;
  if (sensor.body != usual_body(sensor)) json["body"] = json_of(sensor.body);
  return json;
}

void write_sensor(const OutputPath& output, const Sensor& sensor) {
  sensor.check();
  write_file(output, json_of(sensor).dump(2, ' ', true) + "\n");
}

}  // namespace supertac
