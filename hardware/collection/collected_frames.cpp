#include "hardware/collection/collected_frames.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "data/sensors/rest_tracker.h"
#include "hardware/ports/errors.h"

namespace supertac {

CollectedFrames frames_in(const Journal& journal, const Sensor& sensor) {
  CollectedFrames all;
  std::vector<FrameArrival> arrivals;
  const auto decoder = make_decoder(sensor);
  const std::size_t signals = sensor.array.signals();
  const bool rig = sensor.frame.kind == FrameKind::board;
  // A damaged header may name an array of a few taxels and thousands of places without one.
  std::uint64_t most_bytes = 1 << 24;
  for (const JournalRecord& record : journal.of(JournalStream::board)) most_bytes += 64 * record.bytes.size();
  std::uint32_t skipped = 0;
  for (const JournalRecord& record : journal.of(JournalStream::board)) {
    if (record.kind != RecordKind::received) continue;
    const std::uint64_t torn = decoder->counters().torn;
    bool first = true;
    decoder->push(record.bytes, [&](const DecodedFrame& frame) {
      const std::size_t before = all.signals.size();
      if (sizeof(float) * before > most_bytes)
        throw JournalError("journal: its sensor, " + sensor.array.text() + ", makes frames of over " +
                           "64 times what was received; is its header damaged?");
      all.signals.resize(before + signals);
      const auto arranged = std::span(all.signals).subspan(before);
      sensor.arrange(frame.values, arranged);
      if (!std::ranges::all_of(arranged, [](float v) { return std::isfinite(v); })) {
        all.signals.resize(before);
        ++skipped;
        return;
      }
      const double paused_s = arrivals.empty() ? 0 : record.time_s - arrivals.back().time_s;
      const bool torn_before = !rig && first && decoder->counters().torn > torn;
      all.suspect.push_back(frame.suspect || frame.jump || torn_before || skipped > 0 ||
                                    (rig && paused_s > 1.5 * rig::kFramePeriodS)
                                ? 1
                                : 0);
      arrivals.push_back({record.time_s, frame.damaged + std::exchange(skipped, 0), frame.time_s});
      first = false;
    });
  }
  all.clock = timeline_of(clock_settings(sensor), arrivals);
  RestTracker rest(sensor);
  for (std::size_t i = 0; i < arrivals.size(); ++i)
    rest.follow(all.clock.dates[i].time_s, std::span(all.signals).subspan(i * signals, signals));
  all.decoder = decoder->counters();
  return all;
}

}  // namespace supertac
