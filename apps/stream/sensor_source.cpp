#include "apps/stream/sensor_source.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>

#include "hardware/collection/capture.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/port_list.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/median.h"

namespace supertac {
namespace {

constexpr char kCaptureHeader[] = R"({"version":1,"kind":"stream"})";

class BoardSource : public SensorSource {
 public:
  /// The capture takes the name `final_name` when it is complete.
  BoardSource(std::unique_ptr<Port> port, std::unique_ptr<JournalWriter> capture, std::string final_name,
              double speedup)
      : SensorSource(rig::kFramePeriodS, 0, true),
        final_name_(std::move(final_name)),
        speedup_(speedup),
        capture_(std::move(capture)),
        board_(capture_ ? std::make_unique<CapturedPort>(std::move(port), *capture_, Stream::board)
                        : std::move(port)) {}

  std::optional<SensorFrame> next(double wait_s) override {
    if (capture_) capture_->check();
    const auto frame = board_.next(wait_s);
    if (!frame) return std::nullopt;
    volts_ = taxel_volts(frame->frame);
    return SensorFrame{frame->time_s, volts_, frame->arrival_s / speedup_};
  }
  bool ended() const override { return false; }
  BoardCounters counters() override { return board_.counters(); }
  void finish() override {
    board_.stop();
    if (!capture_) return;
    capture_->close();
    if (capture_->path() != final_name_ && std::rename(capture_->path().c_str(), final_name_.c_str()) != 0)
      throw FileError(final_name_, "cannot be replaced; the capture is " + capture_->path());
  }

 private:
  std::string final_name_;
  double speedup_;
  std::unique_ptr<JournalWriter> capture_;  // outlives the board, whose port writes to it
  TactileBoard board_;
  std::array<float, kTaxels> volts_{};
};

class ReplaySource : public SensorSource {
 public:
  explicit ReplaySource(const std::string& journal)
      : SensorSource(rig::kFramePeriodS, 0, false),
        board_(std::make_unique<ReplayPort>(read_journal(journal).of(Stream::board), journal),
               {.wait_for_consumer = true}) {}

  std::optional<SensorFrame> next(double wait_s) override {
    try {
      const auto frame = board_.next(wait_s);
      if (!frame) return std::nullopt;
      volts_ = taxel_volts(frame->frame);
      return SensorFrame{frame->time_s, volts_, monotonic_seconds()};
    } catch (const PortUnplugged&) {  // how a capture ends
      ended_ = true;
      return std::nullopt;
    }
  }
  bool ended() const override { return ended_; }
  BoardCounters counters() override { return board_.counters(); }
  void finish() override { board_.stop(); }

 private:
  TactileBoard board_;
  std::array<float, kTaxels> volts_{};
  bool ended_ = false;
};

// Not the mean: lost frames leave a gap.
double median_period(const Recording& recording) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < recording.frames(); ++i)
    steps.push_back(recording.time_s[i] - recording.time_s[i - 1]);
  return median(steps);
}

class RecordingSource : public SensorSource {
 public:
  explicit RecordingSource(Recording recording)
      : SensorSource(median_period(recording), recording.filter_s(), false, recording.array),
        recording_(std::move(recording)) {}

  std::optional<SensorFrame> next(double) override {
    if (ended()) return std::nullopt;
    const std::size_t i = at_++, signals = array().signals();
    SensorFrame frame{recording_.time_s[i], std::span(recording_.volts).subspan(i * signals, signals),
                      monotonic_seconds()};
    if (!recording_.position_mm.empty())
      frame.x_mm = recording_.position_mm[2 * i], frame.y_mm = recording_.position_mm[2 * i + 1];
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

std::unique_ptr<SensorSource> open_board(const std::string& port, double speedup,
                                         const std::string& capture) {
  auto serial =
      std::make_unique<SerialPort>(resolve_board_port(port), SerialSettings{rig::kBoardBaud, speedup});
  // An old capture stays until the new one is complete.
  std::error_code error;
  const std::string name = std::filesystem::exists(capture, error) ? capture + ".new" : capture;
  auto journal = capture.empty() ? nullptr : std::make_unique<JournalWriter>(name, kCaptureHeader);
  return std::make_unique<BoardSource>(std::move(serial), std::move(journal), capture, speedup);
}

std::unique_ptr<SensorSource> open_replay(const std::string& journal) {
  return std::make_unique<ReplaySource>(journal);
}

std::unique_ptr<SensorSource> open_recording(const std::string& path) {
  Recording recording = read_recording(path);
  if (recording.frames() < 2)
    throw FileError(
        path, "expected a recording of at least two frames, found " + std::to_string(recording.frames()));
  return std::make_unique<RecordingSource>(std::move(recording));
}

}  // namespace supertac
