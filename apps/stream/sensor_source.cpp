#include "apps/stream/sensor_source.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "apps/common/running/signals.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/collection/capture.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/port_list.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"

namespace supertac {
namespace {

constexpr char kCaptureHeader[] = R"({"version":1,"kind":"stream"})";

class BoardSource : public SensorSource {
 public:
  /// The capture takes the name `final_name` when it is complete.
  BoardSource(std::unique_ptr<Port> port, bool live, double speedup = 1,
              std::unique_ptr<JournalWriter> capture = nullptr, std::string final_name = {})
      : SensorSource(rig::kFramePeriodS, 0, live),
        final_name_(std::move(final_name)),
        speedup_(speedup),
        capture_(std::move(capture)),
        board_(capture_ ? std::make_unique<CapturedPort>(std::move(port), *capture_, Stream::board)
                        : std::move(port),
               {.wait_for_consumer = !live}) {}

  std::optional<SensorFrame> next(double wait_s) override {
    if (capture_) capture_->check();
    try {
      const auto frame = board_.next(wait_s);
      if (!frame) return std::nullopt;
      volts_ = taxel_volts(frame->frame);
      return SensorFrame{.time_s = frame->time_s,
                         .volts = volts_,
                         .arrived_s = arrived_s(frame->arrival.time_s, speedup_),
                         .arrival = frame->arrival};
    } catch (const PortUnplugged&) {  // how a capture that is replayed ends
      if (live()) throw;
      ended_ = true;
      return std::nullopt;
    }
  }
  bool ended() const override { return ended_; }
  BoardCounters counters() override { return board_.counters(); }
  void finish() override {
    board_.stop();
    if (!capture_) return;
    capture_->close();
    if (capture_->path() != final_name_) publish(capture_->path(), final_name_);
  }

 private:
  std::string final_name_;
  double speedup_;
  std::unique_ptr<JournalWriter> capture_;  // outlives the board, whose port writes to it
  TactileBoard board_;
  std::array<float, kTaxels> volts_{};
  bool ended_ = false;
};

class ReaderSource : public SensorSource {
 public:
  ReaderSource(OpenedPort opened, const Sensor& sensor, double speedup = 1)
      : SensorSource(1 / sensor.rate_hz, 0, opened.live, sensor),
        speedup_(speedup),
        reader_(std::move(opened), sensor) {}

  std::optional<SensorFrame> next(double wait_s) override {
    auto frame = reader_.next(wait_s);
    if (!frame) return std::nullopt;
    frame_ = std::move(*frame);
    return SensorFrame{
        .time_s = frame_.time_s, .volts = frame_.signals, .arrived_s = arrived_s(frame_.arrival_s, speedup_)};
  }
  bool ended() const override { return reader_.ended(); }
  BoardCounters counters() override { return reader_.counters(); }
  void finish() override { reader_.stop(); }

 private:
  double speedup_;
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
                      .volts = std::span(recording_.volts).subspan(i * signals, signals),
                      .arrived_s = monotonic_seconds(),
                      .wall_s = recording_.began_s() + recording_.time_s[i]};
    if (!recording_.position_mm.empty())
      frame.x_mm = recording_.position_mm[2 * i], frame.y_mm = recording_.position_mm[2 * i + 1];
    if (!recording_.lift_mm.empty()) frame.lift_mm = recording_.lift_mm[i];
    return frame;
  }
  bool ended() const override { return at_ == recording_.frames(); }
  BoardCounters counters() override {
    BoardCounters counters;
    counters.decoder.frames = at_;
    return counters;
  }
  void finish() override {}

 private:
  Recording recording_;
  std::size_t at_ = 0;
};

}  // namespace

SensorSource::SensorSource(double period_s, double filter_s, bool live)
    : period_s_(period_s), filter_s_(filter_s), live_(live) {}

SensorSource::SensorSource(double period_s, double filter_s, bool live, const Sensor& sensor)
    : period_s_(period_s), filter_s_(filter_s), live_(live), sensor_(sensor) {}

double SensorSource::arrived_s(double port_s, double speedup) const {
  return live_ ? port_s / speedup : monotonic_seconds();
}

std::unique_ptr<SensorSource> open_board(const std::string& port, double speedup,
                                         const std::string& capture) {
  auto serial =
      std::make_unique<SerialPort>(resolve_board_port(port), SerialSettings{rig::kBoardBaud, speedup});
  // An old capture stays until the new one is complete.
  std::error_code error;
  const std::string name = std::filesystem::exists(capture, error) ? capture + ".new" : capture;
  auto journal = capture.empty() ? nullptr : std::make_unique<JournalWriter>(name, kCaptureHeader);
  return std::make_unique<BoardSource>(std::move(serial), true, speedup, std::move(journal), capture);
}

std::unique_ptr<SensorSource> open_sensor(const Sensor& sensor, double speedup) {
  constexpr std::string_view kSerial = "serial:";
  const bool calibrated = !sensor.rest.empty() || !sensor.gain.empty() || sensor.follow_rest_s > 0;
  if (sensor.frame.kind == FrameKind::board && sensor.port.starts_with(kSerial) && !calibrated)
    return open_board(sensor.port.substr(kSerial.size(), sensor.port.rfind('@') - kSerial.size()), speedup,
                      "");
  return std::make_unique<ReaderSource>(open_port(sensor, speedup), sensor, speedup);
}

std::unique_ptr<SensorSource> open_replay(const std::string& path,
                                          const std::function<void(const std::string&)>& note) {
  const Journal journal = read_journal(path);
  if (const std::uint64_t bytes = journal.lost_bytes + journal.torn_bytes; bytes > 0)
    note(path + ": " + std::to_string(bytes) + " damaged bytes of the journal are missing");
  const Sensor sensor = sensor_of(journal);
  auto port = std::make_unique<ReplayPort>(journal.of(Stream::board), path, journal.lost_bytes);
  if (sensor.frame.kind == FrameKind::board) return std::make_unique<BoardSource>(std::move(port), false);
  return std::make_unique<ReaderSource>(OpenedPort{.port = std::move(port), .live = false}, sensor);
}

std::unique_ptr<SensorSource> open_recording(const std::string& path) {
  Recording recording = read_recording(path);
  if (recording.frames() < 2)
    throw FileError(
        path, "expected a recording of at least two frames, found " + std::to_string(recording.frames()));
  return std::make_unique<RecordingSource>(std::move(recording));
}

}  // namespace supertac
