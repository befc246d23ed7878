#include "hardware/collection/collected_frames.h"

#include <algorithm>

#include "data/sensors/rest_tracker.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/ports/errors.h"

namespace supertac {
namespace {

void append_arranged(const Sensor& sensor, std::span<const float> sent, std::vector<float>& signals) {
  const std::size_t before = signals.size();
  signals.resize(before + sensor.array.signals());
  sensor.arrange(sent, std::span(signals).subspan(before));
}

CollectedFrames board_frames(const Journal& journal, const Sensor& sensor) {
  constexpr std::size_t kEarlierRead = 2048;  // journals before version 0.3 were read in such pieces
  CollectedFrames all;
  std::vector<FrameArrival> arrivals;
  FrameDecoder decoder;
  JumpDetector jumps;
  for (const JournalRecord& record : journal.of(Stream::board)) {
    if (record.kind != RecordKind::received) continue;
    const bool more_waited = record.bytes.size() >= kTerminalFull || record.bytes.size() == kEarlierRead;
    decoder.push(record.bytes, [&](const BoardFrame& frame, std::uint64_t discarded) {
      const bool late =
          !arrivals.empty() && record.time_s - arrivals.back().time_s > 1.5 * rig::kFramePeriodS;
      all.suspect.push_back(discarded > 0 || late || jumps.jump(frame) ? 1 : 0);
      append_arranged(sensor, taxel_volts(frame), all.signals);
      arrivals.push_back({record.time_s, damaged_frames(discarded), more_waited});
    });
  }
  const FrameTimeline timeline = timeline_of(arrivals);
  RestTracker rest(sensor);
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    const FramePlace& place = timeline.places[i];
    all.arrival_s.push_back(arrivals[i].time_s);
    all.end_s.push_back(timeline.clock.at(static_cast<double>(place.index)));
    rest.follow(all.end_s.back(),
                std::span(all.signals).subspan(i * sensor.array.signals(), sensor.array.signals()));
    all.doubt_s.push_back(place.doubt * timeline.clock.period_s);
    all.missing.push_back(place.index - i);
  }
  all.decoder = decoder.counters();
  all.lost = timeline.missing;
  all.clock = timeline.clock;
  return all;
}

/// The reads of a port as a journal has them, however much of it is lost.
class RecordedReads : public Port {
 public:
  explicit RecordedReads(const std::vector<JournalRecord>& records) : records_(records) {}
  const std::string& name() const override { return name_; }
  double now() override { return time_s_; }
  double write(std::span<const std::byte>, double) override { return time_s_; }

  Received read(std::span<std::byte> buffer, double until) override {
    constexpr double kAtOnceS = 0.002;
    while (at_ < records_.size() && records_[at_].kind != RecordKind::received &&
           records_[at_].kind != RecordKind::timed_out)
      ++at_;
    if (at_ == records_.size()) throw PortEnded("journal: the end");
    const JournalRecord& record = records_[at_];
    // A poll brought what stands next, unless that is lost.
    if (until <= time_s_ && record.time_s > time_s_ + kAtOnceS) return {0, time_s_};
    time_s_ = record.time_s;
    const std::size_t count = std::min(buffer.size(), record.bytes.size() - taken_);
    std::copy_n(record.bytes.begin() + static_cast<std::ptrdiff_t>(taken_), count, buffer.begin());
    taken_ += count;
    if (taken_ == record.bytes.size()) taken_ = 0, ++at_;
    return {count, time_s_};
  }

 private:
  const std::vector<JournalRecord>& records_;
  std::string name_ = "journal";
  std::size_t at_ = 0, taken_ = 0;
  double time_s_ = 0;
};

// Where a clock of its own dated the frames: the port's time is a line under the arrivals.
void bring_to_the_port(CollectedFrames& all, double nominal_s) {
  constexpr double kAnyRate = 0.5;  // of a clock that was checked while it ran
  ClockEstimator estimator(nominal_s, kAnyRate);
  const double first_s = all.size() > 0 ? all.end_s.front() : 0;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (i + 1 == all.size() || all.arrival_s[i + 1] != all.arrival_s[i])
      estimator.add((all.end_s[i] - first_s) / nominal_s, all.arrival_s[i]);
  const ClockFit fit = estimator.fit();
  for (double& end_s : all.end_s) end_s = fit.at((end_s - first_s) / nominal_s);
}

}  // namespace

CollectedFrames frames_in(const Journal& journal, const Sensor& sensor) {
  if (sensor.frame.kind == FrameKind::board) return board_frames(journal, sensor);
  CollectedFrames all;
  FrameReader reader(sensor);
  RecordedReads port(journal.of(Stream::board));
  std::uint64_t before = 0;  // torn, damaged or missing
  // A damaged header may name an array of a few taxels and thousands of places without one.
  constexpr std::uint64_t kMostGrowth = 64, kAlways = 1 << 24;
  std::uint64_t most_bytes = kAlways;
  for (const JournalRecord& record : journal.of(Stream::board))
    most_bytes += kMostGrowth * record.bytes.size();
  try {
    for (;;)
      reader.read(port, true, [&](const ReadFrame& frame) {
        if (sizeof(float) * all.signals.size() > most_bytes)
          throw JournalError("journal: its sensor, " + sensor.array.text() + ", makes frames of over " +
                             std::to_string(kMostGrowth) +
                             " times what was received; is its header damaged?");
        const BoardCounters counted = reader.counters();
        all.signals.insert(all.signals.end(), frame.signals.begin(), frame.signals.end());
        all.arrival_s.push_back(frame.arrival_s);
        all.end_s.push_back(frame.time_s);
        all.doubt_s.push_back(reader.doubt_s());
        all.missing.push_back(counted.missing);
        all.suspect.push_back(counted.suspect + counted.missing > before ? 1 : 0);
        before = counted.suspect + counted.missing;
      });
  } catch (const PortEnded&) {
  }
  const BoardCounters counted = reader.counters();
  all.decoder = counted.decoder;
  all.lost = counted.missing;
  all.clock.period_s = all.clock.measured_s = counted.clock.period_s;
  all.steady = static_cast<int>(std::clamp(all.steady * rig::kFramePeriodS / all.clock.period_s, 1.0, 128.0));
  all.follow = 2 * all.steady;
  if (sensor.frame.time) bring_to_the_port(all, 1 / sensor.rate_hz);
  return all;
}

}  // namespace supertac
