#include "hardware/boards/sensor_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kShown = 120;

bool is_rig(const Sensor& sensor) { return sensor.frame.kind == FrameKind::board; }

double usual_silence_s(const Sensor& sensor) {
  return is_rig(sensor) ? 1 : std::max(3.0, 10 / sensor.rate_hz);
}

}  // namespace

SensorReader::SensorReader(OpenedPort opened, const Sensor& sensor, const ReaderSettings& settings)
    : port_(std::move(opened.port)),
      live_(opened.live),
      sensor_(sensor),
      silence_s_(settings.silence_s > 0 ? settings.silence_s : usual_silence_s(sensor)),
      decoder_(make_decoder(sensor)),
      clock_(clock_settings(sensor, opened.stored)),
      rest_(sensor),
      last_frame_s_(port_->now()),
      most_(settings.queue_frames) {
  thread_ = std::thread([this] { run(); });
}

void SensorReader::run() {
  double time_s = last_frame_s_;
  try {
    try {
      do time_s = read(port_->now() + kReadSlice);
      while (!stop_);
      // What had arrived when the stop was asked for still counts. Where the machine is busy more comes with
      // every read: a port holds a tenth of a second at most.
      double now = port_->now();
      const double end = now + kReadSlice;
      for (std::uint64_t before = ~std::uint64_t{0};
           live_ && now < end && before != decoder_->counters().bytes; now = port_->now()) {
        before = decoder_->counters().bytes;
        time_s = read(now);
      }
    } catch (const PortEnded&) {  // nothing is wrong, but with one that was to go on
      const std::byte end{'\n'};  // which the last line may lack
      const bool lines = sensor_.frame.kind == FrameKind::text || sensor_.frame.kind == FrameKind::json;
      decode({&end, lines ? 1U : 0U}, time_s);
      if (live_)
        throw PortUnplugged("sensor " + sensor_.name + " at " + port_->name() +
                            ": what it sends has ended; see whether its program still runs, and start again");
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  clock_.finish();
  const std::lock_guard lock(mutex_);
  counters_ = counted();
  ended_ = true;
  arrived_.notify_all();
}

double SensorReader::read(double until) {
  std::array<std::byte, 65536> buffer;  // no datagram is longer, and a terminal holds a sixteenth
  const Received got = port_->read(buffer, until);
  const auto bytes = std::span(buffer).first(got.count);
  for (const std::byte byte : bytes.first(std::min(bytes.size(), kShown - without_frame_.size())))
    without_frame_ += std::to_integer<char>(byte);
  decode(bytes, got.time_s);
  check_silence(got.time_s);
  return got.time_s;
}

void SensorReader::decode(std::span<const std::byte> bytes, double time_s) {
  arrivals_.clear();
  decoder_->push(bytes, [&](const DecodedFrame& decoded) {
    if (arrivals_.size() == frames_.size()) frames_.emplace_back().signals.resize(sensor_.array.signals());
    ReadFrame& frame = frames_[arrivals_.size()];
    sensor_.arrange(decoded.values, frame.signals);
    if (!std::ranges::all_of(frame.signals, [](float v) { return std::isfinite(v); })) {
      ++read_.damaged, ++skipped_;
      return;
    }
    frame.arrival = {time_s, decoded.damaged + std::exchange(skipped_, 0), decoded.time_s};
    const bool paused =
        is_rig(sensor_) && last_arrival_s_ && time_s - *last_arrival_s_ > 1.5 * rig::kFramePeriodS;
    frame.suspect = decoded.suspect || paused, frame.jump = decoded.jump;
    last_arrival_s_ = time_s;
    arrivals_.push_back(frame.arrival);
  });
  if (!arrivals_.empty()) {
    without_frame_.clear();
    clock_.date(arrivals_, dates_);
  }
  for (std::size_t n = 0; n < arrivals_.size(); ++n) {
    ReadFrame& frame = frames_[n];
    frame.date = dates_[n];
    read_.suspect += frame.suspect ? 1 : 0, read_.jumps += frame.jump ? 1 : 0;
    rest_.follow(frame.date.time_s, frame.signals);
  }
  take(arrivals_.size());
}

void SensorReader::take(std::size_t count) {
  std::unique_lock lock(mutex_);
  counters_ = counted();
  for (const ReadFrame& frame : std::span(frames_).first(count)) {
    if (live_ && frame.arrival.stamp_s && !clock_checked_)
      check_clock(*frame.arrival.stamp_s, frame.arrival.time_s);
    if (!live_) {
      taken_.wait(lock, [&] { return queue_.size() < most_ || stop_; });
    } else if (queue_.size() >= most_) {
      queue_.pop_front();
      ++read_.dropped;
    }
    queue_.push_back(frame);
    arrived_.notify_one();
  }
}

ReaderCounters SensorReader::counted() const {
  ReaderCounters counters = read_;
  counters.decoder = decoder_->counters();
  counters.missing = clock_.missing(), counters.resets = clock_.resets();
  counters.period_s = clock_.period_s();
  if (!is_rig(sensor_)) counters.suspect += counters.decoder.torn + counters.damaged;
  return counters;
}

void SensorReader::stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  taken_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::optional<ReadFrame> SensorReader::next(double wait_s) {
  std::unique_lock lock(mutex_);
  arrived_.wait_for(lock, std::chrono::duration<double>(wait_s), [&] { return !queue_.empty() || ended_; });
  if (!queue_.empty()) {
    ReadFrame frame = std::move(queue_.front());
    queue_.pop_front();
    taken_.notify_one();
    return frame;
  }
  if (error_) std::rethrow_exception(error_);
  return std::nullopt;
}

void SensorReader::check() {
  const std::lock_guard lock(mutex_);
  if (error_) std::rethrow_exception(error_);
}

bool SensorReader::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_ && queue_.empty() && !error_;
}

void SensorReader::check_silence(double time_s) {
  const SensorDecoder::Counters total = decoder_->counters();
  if (total.frames != decoded_.frames) last_frame_s_ = time_s, decoded_ = total;
  if (!live_ || time_s - last_frame_s_ < silence_s_) return;
  const std::uint64_t bytes = total.bytes - decoded_.bytes;
  const bool rig = is_rig(sensor_), never = total.frames == 0;
  const std::string at = (rig ? "board " : "sensor " + sensor_.name + " at ") + port_->name() + ": expected ";
  const std::string such = ", such as '" + printable(without_frame_, kShown) + "'; ";
  if (never && bytes > 1)
    throw WrongDevice(
        at + "frames of " + std::to_string(sensor_.values()) + " values, found " + std::to_string(bytes) +
        " bytes without one" + such +
        (rig ? "choose the board's port (supertac-check machine), or exchange it and the printer's"
             : "supertac-stream --probe says what they are"));
  std::string found =
      format(sensor_.rate_hz, 0) + " frames/s, found none for " + format(silence_s_, 1) + " s";
  found += bytes > 0 ? " in " + std::to_string(bytes) + " bytes" + such : "; ";
  if (rig && never) found += "is this the board's port (supertac-check machine)? If it is, ";
  throw BoardSilent(at + found +
                    (rig         ? "plug the board out and in again"
                     : bytes > 0 ? "see whether it was switched off or now sends something else "
                                   "(supertac-stream --probe)"
                                 : "see whether it is switched on and sends to this port"));
}

// Right after the start: a clock in another unit than the file says is a thousand times too fast or too slow.
// A single jump says nothing: old frames may have waited, or a clock may just have been set. Frames that come
// faster than they were made are a log that somebody sends.
void SensorReader::check_clock(double stamp_s, double arrival_s) {
  constexpr double kMostOff = 300;
  if (checked_frames_++ == 0) checked_time_s_ = stamp_s, first_arrival_s_ = arrival_s;
  const double step_s = std::abs(stamp_s - std::exchange(checked_time_s_, stamp_s));
  longest_step_s_ = std::max(longest_step_s_, step_s), went_s_ += step_s;
  const double elapsed = arrival_s - first_arrival_s_;
  if (elapsed < 1 || checked_frames_ < 5) return;
  clock_checked_ = true;
  const double ratio = went_s_ / elapsed, steady = ratio - longest_step_s_ / elapsed;
  const bool log = static_cast<double>(checked_frames_) / elapsed > 3 * sensor_.rate_hz;
  if (log || (steady < kMostOff && ratio > 1 / kMostOff)) return;
  throw WrongDevice("sensor " + sensor_.name + " at " + port_->name() + ": its time stamps go " +
                    format(ratio, ratio < 1 ? 6 : 0) +
                    " s a second; see whether its file names the right column and unit (s, ms, us) of time");
}

ReaderCounters SensorReader::counters() {
  const std::lock_guard lock(mutex_);
  return counters_;
}

std::vector<Heard> listen(const OpenedPort& opened, const std::string& port, double seconds,
                          const std::function<bool()>& stop) {
  std::vector<Heard> heard;
  std::vector<std::byte> buffer(65536);
  std::size_t bytes = 0;
  // A machine that stands still listens to nothing: of each wait no more counts than was asked for.
  double now = opened.port->now(), listened = 0;
  try {
    while (!stop() && listened < seconds && bytes < (16 << 20)) {
      const Received got = opened.port->read(buffer, now + kReadSlice);
      const double before = std::exchange(now, opened.port->now());
      listened += std::min(now - before, kReadSlice);
      if (got.count == 0) continue;
      heard.push_back({got.time_s, {reinterpret_cast<const char*>(buffer.data()), got.count}});
      // As open_port() makes a line of it for a sensor that is known to send text.
      std::string& text = heard.back().bytes;
      if (port.starts_with("udp:") && std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; }))
        text += '\n';
      bytes += got.count;
    }
  } catch (const PortUnplugged&) {
  }
  return heard;
}

}  // namespace supertac
