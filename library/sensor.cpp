#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "data/frames/probe.h"
#include "data/sensors/sensor.h"
#include "hardware/boards/sensor_reader.h"
#include "library/guard.h"
#include "library/supertac.h"

using namespace supertac;
using c::expect, c::expect_within, c::guarded;

struct supertac_sensor {
  Sensor sensor;
  std::unique_ptr<SensorReader> reader;
  std::string probed;
};

namespace {

Sensor at_port(const supertac_sensor& s, const char* port) {
  Sensor sensor = s.sensor;
  if (port != nullptr) sensor.port = port;
  return sensor;
}

}  // namespace

supertac_sensor* supertac_sensor_new(const char* path) {
  return guarded(__func__, {path}, [&] { return new supertac_sensor{read_sensor(path), nullptr, {}}; });
}

void supertac_sensor_free(supertac_sensor* sensor) { delete sensor; }

int supertac_sensor_describe(const supertac_sensor* sensor, supertac_sensor_description* description) {
  return guarded(__func__, {sensor, description}, [&] {
    const Sensor& s = sensor->sensor;
    return c::describe(description,
                       supertac_sensor_description{.size = 0,
                                                   .name = s.name.c_str(),
                                                   .unit = s.scale.unit.c_str(),
                                                   .port = s.port.c_str(),
                                                   .rows = s.array.rows,
                                                   .columns = s.array.columns,
                                                   .channels = s.array.channels,
                                                   .signals = static_cast<int>(s.array.signals()),
                                                   .pitch_mm = {s.array.pitch_mm.x, s.array.pitch_mm.y},
                                                   .rate_hz = s.rate_hz,
                                                   .rest = s.scale.rest,
                                                   .span = s.scale.span});
  });
}

int supertac_sensor_start(supertac_sensor* sensor, const char* port) {
  return guarded(__func__, {sensor}, [&] {
    expect(sensor->reader == nullptr, "supertac_sensor_start: it is being read already");
    const Sensor at = at_port(*sensor, port);
    sensor->reader = std::make_unique<SensorReader>(open_port(at), at);
    return 0;
  });
}

int supertac_sensor_next(supertac_sensor* sensor, double wait_s, supertac_frame* about, float* signals) {
  return guarded(__func__, {sensor, about, signals}, [&] {
    expect(sensor->reader != nullptr, "supertac_sensor_next: call supertac_sensor_start first");
    expect_within("supertac_sensor_next: wait_s", wait_s, 0, 3600);
    const std::optional<ReadFrame> frame = sensor->reader->next(wait_s);
    if (!frame) return sensor->reader->ended() ? SUPERTAC_ENDED : 0;
    const FrameLoad load = load_of(frame->signals, sensor->sensor.array.channels, sensor->sensor.scale);
    *about = {frame->date.time_s, load.total_force, load.saturated};
    std::ranges::copy(frame->signals, signals);
    return 1;
  });
}

int supertac_sensor_lost(supertac_sensor* sensor, unsigned long long* missing, unsigned long long* dropped) {
  return guarded(__func__, {sensor, missing, dropped}, [&] {
    expect(sensor->reader != nullptr, "supertac_sensor_lost: call supertac_sensor_start first");
    const ReaderCounters counters = sensor->reader->counters();
    *missing = counters.missing, *dropped = counters.dropped;
    return 0;
  });
}

const char* supertac_sensor_probe(supertac_sensor* sensor, const char* port, double seconds) {
  return guarded(__func__, {sensor}, [&] {
    expect(sensor->reader == nullptr, "supertac_sensor_probe: it is being read");
    expect_within("supertac_sensor_probe: seconds", seconds, 0.1, 600);
    const Sensor at = at_port(*sensor, port);
    const ProbeReport report =
        probe(listen(open_port(at.port), at.port, seconds, [] { return false; }), at.port, at);
    nlohmann::ordered_json json = {{"says", report.says}, {"draft", nullptr}};
    if (report.draft) json["draft"] = json_of(*report.draft);
    sensor->probed = json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
    return sensor->probed.c_str();
  });
}
