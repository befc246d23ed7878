#include "hardware/collection/collection.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <ranges>
#include <utility>

#include "data/sensors/rest_tracker.h"
#include "hardware/ports/errors.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

std::string point_text(const Point3& p) {
  return format(p.x, 4) + " " + format(p.y, 4) + " " + format(p.z, 4);
}

/// The numbers behind an event's first word; none where one of them is no number.
std::vector<double> numbers_of(std::string_view text) {
  std::vector<double> values;
  for (const std::string_view word : split_line(text, ' ') | std::views::drop(1)) {
    const std::optional<double> value = parse_double(word);
    if (!value || !(std::abs(*value) < kLatestTime)) return {};
    values.push_back(*value);
  }
  return values;
}

struct RecordedLeg {
  Leg leg;  // that ended where it has a time for that
  std::vector<PositionSample> samples;
};

// The end names its leg whole: the beginning may be lost with a damaged part of the journal.
void end_leg(std::vector<RecordedLeg>& legs, const Leg& leg) {
  if (legs.empty() || legs.back().leg.accepted_s != leg.accepted_s) {
    RecordedLeg found{leg, {}};
    if (!legs.empty()) {
      auto& before = legs.back().samples;
      const auto first = std::find_if(before.begin(), before.end(),
                                      [&](const PositionSample& s) { return s.time_s >= leg.accepted_s; });
      found.samples.assign(first, before.end());
      before.erase(first, before.end());
    }
    legs.push_back(std::move(found));
  }
  legs.back().leg.ended_s = leg.ended_s;
}

std::vector<RecordedLeg> legs_in(const Journal& journal, bool& complete) {
  std::vector<RecordedLeg> legs;
  for (const JournalRecord& record : journal.of(JournalStream::event)) {
    const std::string text = record.text();
    if (text == kRunComplete) complete = true;
    std::vector<double> n = numbers_of(text);
    if (text.starts_with("leg ")) {
      if (n.size() == 12) n.push_back(0);  // before they held when the move was sent
      if (n.size() != 13 || n[1] < 1 || n[2] < 0 || n[2] > static_cast<int>(Phase::reposition)) continue;
      const Leg leg{static_cast<int>(std::min(n[1], 1e6)),
                    static_cast<Phase>(static_cast<int>(n[2])),
                    {n[3], n[4], n[5]},
                    {n[6], n[7], n[8]},
                    n[9],
                    n[10],
                    n[0] != 0 ? n[11] : 0,
                    n[12] > 0 ? n[12] : n[10]};
      if (n[0] != 0)
        end_leg(legs, leg);
      else
        legs.push_back({leg, {}});
    } else if (text.starts_with("at ") && n.size() == 5 && !legs.empty()) {
      legs.back().samples.push_back({n[0], n[1], {n[2], n[3], n[4]}});
    }
  }
  return legs;
}

/// All frames of a journal, decoded and dated on the clock that the printer's positions have.
struct CollectedFrames {
  std::vector<float> signals;         // n x array.signals(), as Sensor::arrange()
  FrameTimeline clock;                // dates: n, when the sensor had finished each
  std::vector<std::uint8_t> suspect;  // n; 1: may be torn, or an implausible jump
};

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
  return all;
}

/// Gives a pass the frames that were made during its track, and says what is doubtful of them.
void add_frames(CollectedPass& pass, const CollectedFrames& all, std::size_t signals,
                const PositionTrack& track) {
  std::uint64_t before = 0, last = 0;
  for (std::size_t i = 0; i < all.clock.dates.size(); ++i) {
    const FrameDate& date = all.clock.dates[i];
    const double time = date.time_s - 0.5 * all.clock.period_s;
    if (time < track.begin() || time > track.end()) continue;
    if (pass.time_s.empty() && pass.left_out == 0) before = date.missing;
    last = date.missing;
    const auto [at_s, p, head_mm] = track.at(time);
    // Where the head alone is doubted by more than that, the pass says so.
    if (date.doubt_s() * pass.speed + (head_mm > kTrustedMm ? 0 : head_mm) > kTrustedMm) {
      ++pass.left_out;
      continue;
    }
    pass.time_s.push_back(time - track.begin());
    const auto frame = std::span(all.signals).subspan(i * signals, signals);
    pass.signals.insert(pass.signals.end(), frame.begin(), frame.end());
    pass.position.insert(pass.position.end(), {p.x, p.y, p.z});
    pass.suspect.push_back(all.suspect[i]);
  }
  pass.missing = last - before;
  if (!all.clock.plausible)
    pass.doubt = "frames came every " + format(1e6 * all.clock.measured_s, 1) + " us, the stated " +
                 format(1e6 * all.clock.period_s, 1) + " us are used; ";
  pass.doubt += track.doubt(kTrustedMm);
  const std::uint64_t kept = pass.time_s.size(), made = kept + pass.left_out + pass.missing;
  if (static_cast<double>(kept) < 0.75 * static_cast<double>(made))
    pass.doubt += "only " + std::to_string(kept) + " of " + std::to_string(made) + " frames were kept; ";
  pass.doubt.resize(pass.doubt.size() - std::min<std::size_t>(2, pass.doubt.size()));
}

// What stands under `key` in the header, by `read`; what it is by default where nothing does.
template <class Read>
auto part_of_header(const Journal& journal, const char* key, const Read& read) {
  const std::string where = std::string("the journal's header: \"") + key + "\"";
  nlohmann::ordered_json json;
  try {
    json = parse_json_limited(journal.header);
  } catch (const JsonError&) {  // not of supertac-collect, which says so where it needs more of it
  }
  try {
    return json.contains(key) ? read(json[key].dump(), where) : decltype(read("", where)){};
  } catch (const FileError& error) {
    throw JournalError(error.what());
  }
}

}  // namespace

std::string event_text(const Leg& leg, bool ended) {
  return std::string("leg ") + (ended ? "1 " : "0 ") + std::to_string(leg.pass) + " " +
         std::to_string(static_cast<int>(leg.phase)) + " " + point_text(leg.from) + " " + point_text(leg.to) +
         " " + format(leg.speed, 4) + " " + format(leg.accepted_s, 6) + " " + format(leg.ended_s, 6) + " " +
         format(leg.sent_s, 6);
}

std::string event_text(const PositionSample& sample) {
  return "at " + format(sample.time_s, 6) + " " + format(sample.round_trip_s, 6) + " " +
         point_text(sample.position);
}

double named_speed(double measured, double ordered) {
  if (!(measured > 0 && ordered > 0) || std::abs(measured / ordered - 1) < 0.005) return ordered;
  char digits[32];
  const char* end = std::to_chars(digits, std::end(digits), measured, std::chars_format::general, 3).ptr;
  return *parse_double({digits, end});
}

Sensor sensor_of(const Journal& journal) { return part_of_header(journal, "sensor", sensor_of_json); }

Collection collection_of(const Journal& journal) {
  Collection collection;
  const std::vector<RecordedLeg> legs = legs_in(journal, collection.complete);
  collection.sensor = sensor_of(journal);
  collection.bed = part_of_header(journal, "bed", bed_of_json);
  CollectedFrames all = frames_in(journal, collection.sensor);
  std::vector<Leg> ended;
  for (const RecordedLeg& recorded : legs)
    if (recorded.leg.ended_s > 0) ended.push_back(recorded.leg);
  MoveTiming timing = timing_of(ended);
  for (const auto& [leg, samples] : legs)
    if (leg.speed > 0) timing.faster = std::max(timing.faster, fitted_speed(leg, samples) / leg.speed);
  std::map<int, std::pair<CollectedPass, PositionTrack>> passes;
  for (const auto& [leg, samples] : legs) {
    if (leg.phase != Phase::onset && leg.phase != Phase::slide && leg.phase != Phase::release) continue;
    auto& [pass, track] = passes[leg.pass];
    track.add_leg(leg, samples, timing);
    pass.positions += samples.size();
    if (leg.phase == Phase::slide) pass.speed = leg.speed;
    if (leg.phase == Phase::release) pass.complete = leg.ended_s > 0;
  }
  for (auto& [number, both] : passes) {
    auto& [pass, track] = both;
    pass.pass = number;
    pass.measured_speed = track.speed();
    pass.rejected_positions = track.rejected();
    add_frames(pass, all, collection.sensor.array.signals(), track);
    collection.passes.push_back(std::move(pass));
  }
  collection.clock = std::move(all.clock);
  return collection;
}

}  // namespace supertac
