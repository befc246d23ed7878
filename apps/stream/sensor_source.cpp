#include "apps/stream/sensor_source.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "apps/common/running/signals.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/collection/collection.h"
#include "hardware/collection/journal.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"

namespace supertac {
namespace {

constexpr char kCaptureHeader[] = R"({"version":1,"kind":"stream"})";

class PortSource : public SensorSource {
 public:
  PortSource(OpenedPort opened, const Sensor& sensor, double speedup = 1,
             std::unique_ptr<JournalWriter> capture = nullptr, std::string path = "")
      : SensorSource(1 / sensor.rate_hz, 0, opened.live, sensor),
        // A recording of the rig's board is dated by all of its arrivals.
        by_arrival_(sensor.frame.kind == FrameKind::board),
        speedup_(speedup),
        capture_(std::move(capture)),
        path_(std::move(path)),
        reader_(std::move(opened), sensor) {}

  std::optional<SensorFrame> next(double wait_s) override {
    if (capture_) capture_->check();
    auto frame = reader_.next(wait_s);
    if (!frame) return std::nullopt;
    frame_ = std::move(*frame);
    SensorFrame out{.time_s = frame_.date.time_s,
                    .signals = frame_.signals,
                    // On the port's clock; what is not live arrives as it is taken.
                    .arrived_s = live() ? frame_.arrival.time_s / speedup_ : monotonic_seconds()};
    if (by_arrival_) out.arrival = frame_.arrival;
    return out;
  }
  bool ended() const override { return reader_.ended(); }
  ReaderCounters counters() override { return reader_.counters(); }
  void finish() override {
    reader_.stop();
    if (!capture_) return;
    capture_->close();
    if (capture_->path() != path_) publish(capture_->path(), path_);
  }

 private:
  bool by_arrival_;
  double speedup_;
  std::unique_ptr<JournalWriter> capture_;  // outlives the reader, whose port writes to it
  std::string path_;                        // that it gets when it is complete
  ReadFrame frame_;
  SensorReader reader_;
};

class RecordingSource : public SensorSource {
 public:
  explicit RecordingSource(Recording recording)
      : SensorSource(recording.period_s(), recording.filter_s(), false,
                     {.array = recording.array,
                      .scale = recording.signal_scale,
                      .body = recording.body.value_or(Body::usual(recording.array))}),
        recording_(std::move(recording)) {}

  std::optional<SensorFrame> next(double) override {
    if (ended()) return std::nullopt;
    const std::size_t i = at_++, signals = array().signals();
    SensorFrame frame{.time_s = recording_.time_s[i],
                      .signals = std::span(recording_.signals).subspan(i * signals, signals),
                      .arrived_s = monotonic_seconds(),
                      .wall_s = recording_.began_s() + recording_.time_s[i]};
    if (!recording_.position_mm.empty())
      frame.x_mm = recording_.position_mm[2 * i], frame.y_mm = recording_.position_mm[2 * i + 1];
    if (!recording_.lift_mm.empty()) frame.lift_mm = recording_.lift_mm[i];
    return frame;
  }
  bool ended() const override { return at_ == recording_.frames(); }
  ReaderCounters counters() override {
    ReaderCounters counters;
    counters.decoder.frames = at_;
    return counters;
  }
  void finish() override {}

 private:
  Recording recording_;
  std::size_t at_ = 0;
};

}  // namespace

std::unique_ptr<SensorSource> open_sensor(const Sensor& sensor, double speedup, const std::string& capture) {
  OpenedPort opened = open_port(sensor, speedup);
  if (capture.empty()) return std::make_unique<PortSource>(std::move(opened), sensor, speedup);
  // An old file stays until the new one is complete.
  auto kept = std::make_unique<JournalWriter>(std::filesystem::exists(capture) ? capture + ".new" : capture,
                                              kCaptureHeader);
  opened.port = std::make_unique<CapturedPort>(std::move(opened.port), *kept, JournalStream::board);
  return std::make_unique<PortSource>(std::move(opened), sensor, speedup, std::move(kept), capture);
}

std::unique_ptr<SensorSource> open_replay(const std::string& path,
                                          const std::function<void(const std::string&)>& note) {
  const Journal journal = read_journal(path);
  if (const std::uint64_t bytes = journal.lost_bytes + journal.torn_bytes; bytes > 0)
    note(path + ": " + std::to_string(bytes) + " damaged bytes of the journal are missing");
  const Sensor sensor = sensor_of(journal);
  auto port = std::make_unique<ReplayPort>(journal.of(JournalStream::board), path, journal.lost_bytes);
  return std::make_unique<PortSource>(OpenedPort{.port = std::move(port), .live = false}, sensor);
}

std::unique_ptr<SensorSource> open_recording(const std::string& path) {
  Recording recording = read_recording(path);
  if (recording.frames() < 2)
    throw FileError(
        path, "expected a recording of at least two frames, found " + std::to_string(recording.frames()));
  return std::make_unique<RecordingSource>(std::move(recording));
}

}  // namespace supertac
