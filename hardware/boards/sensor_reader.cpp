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

constexpr double kReadSlice = 0.05, kSilenceS = 3, kSilentPeriods = 10;
constexpr std::size_t kReadBytes = 65536;  // no datagram is longer
constexpr double kChunkS = 0.12;  // an adapter hands bytes on up to 0.1 s late: frames are lost beyond
constexpr double kJumpS = 0.1, kJumpPeriods = 10;  // stamps farther from the one before are a jump
constexpr double kMostStampS = 1e11;               // three thousand years; a double still tells 20 us apart
constexpr std::uint64_t kBlock = 64;
constexpr std::size_t kShown = 120;
constexpr int kMostReads = 64;  // of what waited

}  // namespace

FrameDates::FrameDates(const Sensor& sensor, bool stored)
    : stored_(stored), nominal_s_(1 / sensor.rate_hz), period_s_(nominal_s_) {
  if (!sensor.frame.time) return;
  if (sensor.frame.time->unit_s > 0.25 * nominal_s_) coarse_s_ = sensor.frame.time->unit_s;
  const std::string& type = sensor.frame.time->type;
  // millis() and micros() of lines and JSON have 32 bits.
  const double bits = type == "u16"                                                      ? 16
                      : type == "u64" || type == "f64" || sensor.frame.time->unit_s == 1 ? 0
                                                                                         : 32;
  if (bits > 0) wraps_s_ = std::exp2(bits) * sensor.frame.time->unit_s;
}

std::optional<double> FrameDates::date(std::optional<double> stamp_s, double arrival_s, std::size_t behind) {
  resynchronised_ = false;
  const auto dated = stamp_s ? by_stamp(*stamp_s, arrival_s) : std::optional(by_arrival(arrival_s, behind));
  if (!dated) return std::nullopt;
  double time = *dated;
  if (count_ > 0 && time <= last_s_ && time > last_s_ - coarse_s_) time = last_s_ + 1e-3 * coarse_s_;
  if (count_ > 0 && time <= last_s_) return std::nullopt;
  if (count_ > 0 && !resynchronised_) count_missing(time - last_s_, stamp_s.has_value());
  ++count_;
  last_s_ = time, last_arrival_s_ = arrival_s;
  return time;
}

// Stamps that are always as far apart are a slower sensor than its file says, which loses nothing.
void FrameDates::count_missing(double step_s, bool stamped) {
  constexpr std::uint64_t kAlways = 8;
  // Stamps of a coarse clock are up to half a unit off, to either side.
  const double periods = (stamped ? step_s - coarse_s_ / 2 : step_s) / period_s_;
  const auto missing =
      periods > 1.5 ? static_cast<std::uint64_t>(std::lround(std::min(periods - 1, 1e9))) : 0;
  missing_ += missing;
  if (!stamped) return;
  if (periods < 1.5) period_s_ += (step_s - period_s_) / 64;
  const bool as_before = std::abs(step_s - regular_step_s_) < 0.25 * regular_step_s_;
  regular_ = as_before ? regular_ + 1 : 0;
  regular_missing_ = as_before ? regular_missing_ + missing : missing;
  regular_step_s_ = step_s;
  if (regular_ < kAlways || missing == 0) return;
  period_s_ = step_s;
  missing_ -= std::exchange(regular_missing_, 0);
}

// A damaged stamp may be anything, and what it said would hold for all that follow. So a jump is believed
// when the arrivals bear it out, or the next stamp goes on from it: then frames were lost, or the sensor has
// started anew. A sensor that is far slower than its file says jumps as far every time.
std::optional<double> FrameDates::by_stamp(double stamp_s, double arrival_s) {
  if (!(std::abs(stamp_s) < kMostStampS)) return std::nullopt;
  if (count_ == 0) return stamp_s;
  const double farthest = std::max(kJumpS, kJumpPeriods * std::max(nominal_s_, step_s_));
  double ahead = stamp_s + offset_s_ - last_s_;
  const bool runs_over = wraps_s_ > 0 && ahead < -0.5 * wraps_s_;
  if (runs_over) ahead += wraps_s_;
  if (ahead > farthest || ahead < -kJumpS) {
    const double from_jump = jumped_s_ ? stamp_s - *jumped_s_ : 0;
    const bool arrived = ahead > 0 && std::abs(ahead - (arrival_s - last_arrival_s_)) < kJumpS;
    const bool again = from_jump > 0 && std::abs(from_jump - jump_step_s_) < 0.5 * jump_step_s_;
    jumped_s_ = stamp_s, jump_step_s_ = from_jump;
    if (!arrived && !again && (from_jump <= 0 || from_jump > farthest)) return std::nullopt;
    if (again) step_s_ = from_jump;
    if (ahead < 0) offset_s_ += std::max(arrival_s - last_arrival_s_, nominal_s_) - ahead;
  }
  jumped_s_.reset();
  jump_step_s_ = 0;
  if (runs_over) offset_s_ += wraps_s_;
  return stamp_s + offset_s_;
}

// The rate that a sensor's file names is a word, not a clock: the least lateness of every block moves the
// dates, and its drift the period. Frames that come late without a silence before them are made more slowly
// than was said; none is lost. Those behind a silence, in the same burst, make up for it.
double FrameDates::by_arrival(double arrival_s, std::size_t behind) {
  if (stored_) return count_ == 0 ? arrival_s : last_s_ + nominal_s_;
  const double waited_s = static_cast<double>(behind) * period_s_;
  if (arrival_s - last_arrival_s_ > 0.5 * period_s_) doubt_s_ = 0;  // no longer of a burst
  ++since_sync_;
  if (count_ == 0) {
    synchronised_s_ = arrival_s, since_sync_ = 0;
    return arrival_s - waited_s;
  }
  const double due = last_s_ + period_s_, late = arrival_s - waited_s - due;
  const double earliest = last_s_ + 0.01 * period_s_;  // frames that arrive at once follow each other still
  const double most_late = std::max(kChunkS, 3 * period_s_);
  const bool silent = arrival_s - last_arrival_s_ > most_late;
  if (late > most_late && (silent || behind == 0)) {
    if (!silent) {
      const double found = (arrival_s - synchronised_s_) / static_cast<double>(since_sync_);
      period_s_ = std::clamp(found, 0.1 * nominal_s_, 10 * nominal_s_);
      resynchronised_ = true;
    } else {
      doubt_s_ = late;  // those that were lost may be any of this burst
    }
    synchronised_s_ = arrival_s, since_sync_ = 0, in_block_ = 0;
    return arrival_s - waited_s;
  }
  least_late_s_ = in_block_ == 0 ? late : std::min(least_late_s_, late);
  most_late_s_ = in_block_ == 0 ? late : std::max(most_late_s_, late);
  if (++in_block_ == kBlock) {
    // Frames that are early are dated by their arrival, so that each is early anew.
    const double drift = most_late_s_ < 0 ? most_late_s_ : least_late_s_ / static_cast<double>(kBlock);
    period_s_ = std::clamp(period_s_ + 0.5 * drift, 0.1 * nominal_s_, 10 * nominal_s_);
    in_block_ = 0;
    return std::max(earliest, std::min(arrival_s, due + std::min(0.5 * least_late_s_, 0.4 * period_s_)));
  }
  return late >= 0 ? due : std::max(arrival_s - waited_s, earliest);
}

ReaderCounters::operator BoardCounters() const {
  BoardCounters counters;
  counters.decoder = {decoder.bytes, decoder.frames, decoder.discarded_bytes};
  counters.dropped = dropped;
  counters.missing = missing;
  counters.suspect = decoder.torn + damaged + late;
  counters.clock.period_s = period_s;
  return counters;
}

FrameReader::FrameReader(const Sensor& sensor, bool stored)
    : sensor_(sensor), decoder_(make_decoder(sensor)), dates_(sensor, stored), rest_(sensor) {
  frame_.signals.resize(sensor.array.signals());
}

double FrameReader::read(Port& port, bool live, const Sink& sink) {
  std::array<std::byte, kReadBytes> buffer;
  Received got = port.read(buffer, port.now() + kReadSlice);
  const auto bytes = std::span(buffer).first(got.count);
  const std::uint64_t before = decoder_->counters().frames;
  if (without_frame_.size() < kShown)
    for (const std::byte byte : bytes) without_frame_ += std::to_integer<char>(byte);
  times_read_s_.clear(), values_read_.clear();
  const auto keep = [&](const DecodedFrame& frame) {
    times_read_s_.push_back(frame.time_s);
    values_read_.insert(values_read_.end(), frame.values.begin(), frame.values.end());
  };
  decoder_->push(bytes, keep);
  // A host that stood still finds what waited meanwhile in several reads.
  const bool stood_still = got.time_s - last_read_s_ > kChunkS;
  std::exception_ptr end;  // what came before it is handed over first
  try {
    for (int more = 0; stood_still && live && more < kMostReads; ++more) {
      const Received rest = port.read(buffer, port.now());
      if (rest.count == 0) break;
      decoder_->push(std::span(buffer).first(rest.count), keep);
      got.time_s = rest.time_s;
    }
  } catch (...) {
    end = std::current_exception();
  }
  last_read_s_ = got.time_s;
  if (decoder_->counters().frames != before) without_frame_.clear();
  const std::size_t count = times_read_s_.size(), size = sensor_.values();
  for (std::size_t n = 0; n < count; ++n)
    take({std::span(values_read_).subspan(n * size, size), times_read_s_[n]}, got.time_s, count - 1 - n,
         sink);
  if (end) std::rethrow_exception(end);
  return got.time_s;
}

void FrameReader::finish(double time_s, const Sink& sink) {
  const std::byte end{'\n'};
  if (sensor_.frame.kind == FrameKind::text || sensor_.frame.kind == FrameKind::json)
    decoder_->push({&end, 1}, [&](const DecodedFrame& frame) { take(frame, time_s, 0, sink); });
}

void FrameReader::take(const DecodedFrame& decoded, double arrival_s, std::size_t behind, const Sink& sink) {
  sensor_.arrange(decoded.values, frame_.signals);
  const bool damaged = !std::ranges::all_of(frame_.signals, [](float v) { return std::isfinite(v); }) ||
                       (decoded.time_s && !std::isfinite(*decoded.time_s));
  const auto time = damaged ? std::nullopt : dates_.date(decoded.time_s, arrival_s, behind);
  damaged_ += damaged ? 1 : 0, late_ += !damaged && !time ? 1 : 0;
  if (!time) return;
  frame_.time_s = *time, frame_.arrival_s = arrival_s;
  rest_.follow(*time, frame_.signals);
  sink(frame_);
}

ReaderCounters FrameReader::counters() const {
  return {.decoder = decoder_->counters(),
          .damaged = damaged_,
          .late = late_,
          .missing = dates_.missing(),
          .period_s = dates_.period_s()};
}

SensorReader::SensorReader(OpenedPort opened, const Sensor& sensor)
    : FrameQueue(kQueueFrames, !opened.live),
      port_(std::move(opened.port)),
      live_(opened.live),
      sensor_(sensor),
      frames_(sensor, opened.stored),
      last_frame_s_(port_->now()) {
  thread_ = std::thread([this] { run(); });
}

void SensorReader::run() {
  double time_s = last_frame_s_;
  try {
    do {
      time_s = frames_.read(*port_, live_, sink_);
      check_silence(time_s);
      const std::lock_guard lock(mutex_);
      counters_ = frames_.counters();
    } while (!asked_to_stop());
  } catch (const PortEnded&) {  // nothing is wrong, but with one that was to go on
    frames_.finish(time_s, sink_);
    const std::lock_guard lock(mutex_);
    if (live_)
      error_ = std::make_exception_ptr(PortUnplugged("sensor " + sensor_.name + " at " + port_->name() +
                                                     ": what it sends has ended; see whether its program "
                                                     "still runs, and start again"));
  } catch (...) {
    const std::lock_guard lock(mutex_);
    error_ = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  counters_ = frames_.counters();
  end();
}

double SensorReader::silence_s(const Sensor& sensor) {
  return std::max(kSilenceS, kSilentPeriods / sensor.rate_hz);
}

void SensorReader::check_silence(double time_s) {
  const SensorDecoder::Counters counted = frames_.counters().decoder;
  if (counted.frames != decoded_.frames) last_frame_s_ = time_s, decoded_ = counted;
  if (!live_ || time_s - last_frame_s_ < silence_s(sensor_)) return;
  const std::string at = "sensor " + sensor_.name + " at " + port_->name() + ": expected ";
  const std::uint64_t bytes = counted.bytes - decoded_.bytes;
  const std::string such = ", such as '" + printable(frames_.without_frame(), kShown) + "'; ";
  if (counted.frames == 0 && bytes > 0)
    throw WrongDevice(at + "frames of " + std::to_string(sensor_.values()) + " values, found " +
                      std::to_string(bytes) + " bytes without one" + such +
                      "supertac-stream --probe says what they are");
  throw BoardSilent(
      at + format(sensor_.rate_hz, 0) + " frames/s, found none for " + format(silence_s(sensor_), 1) + " s" +
      (bytes > 0 ? " in " + std::to_string(bytes) + " bytes" + such + "see whether it was switched off or " +
                       "now sends something else (supertac-stream --probe)"
                 : "; see whether it is switched on and sends to this port"));
}

// Right after the start: a clock in another unit than the file says is a thousand times too fast or too slow.
// A single jump says nothing: old frames may have waited, or a clock may just have been set. Frames that come
// faster than they were made are a log that somebody sends.
void SensorReader::check_clock(double time_s, double arrival_s) {
  constexpr double kLongEnoughS = 1, kMostOff = 300, kMostHaste = 3;
  if (checked_frames_++ == 0) first_time_s_ = checked_time_s_ = time_s, first_arrival_s_ = arrival_s;
  longest_step_s_ = std::max(longest_step_s_, time_s - std::exchange(checked_time_s_, time_s));
  const double elapsed = arrival_s - first_arrival_s_;
  if (elapsed < kLongEnoughS || checked_frames_ < 5) return;
  clock_checked_ = true;
  const double ratio = (time_s - first_time_s_) / elapsed, steady = ratio - longest_step_s_ / elapsed;
  const bool log = static_cast<double>(checked_frames_) / elapsed > kMostHaste * sensor_.rate_hz;
  if (log || (steady < kMostOff && ratio > 1 / kMostOff)) return;
  throw WrongDevice("sensor " + sensor_.name + " at " + port_->name() + ": its time stamps go " +
                    format(ratio, ratio < 1 ? 6 : 0) +
                    " s a second; see whether its file names the right column and unit (s, ms, us) of time");
}

void SensorReader::take(const ReadFrame& frame) {
  if (live_ && sensor_.frame.time && !clock_checked_) check_clock(frame.time_s, frame.arrival_s);
  std::unique_lock lock(mutex_);
  counters_ = frames_.counters();
  put(lock, frame);
}

ReaderCounters SensorReader::counters() {
  const std::lock_guard lock(mutex_);
  ReaderCounters counters = counters_;
  counters.dropped = dropped_;
  return counters;
}

}  // namespace supertac
