#include "hardware/collection/collection.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "data/sensors/rest_tracker.h"
#include "hardware/ports/errors.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

std::string point_text(const Point3& p) {
  return format(p.x, 4) + " " + format(p.y, 4) + " " + format(p.z, 4);
}

// The numbers behind an event's first word; nothing when there are not exactly `Count`.
template <std::size_t Count>
std::optional<std::array<double, Count>> numbers_of(std::string_view text) {
  std::array<double, Count> values{};
  std::size_t at = text.find(' ');
  for (double& value : values) {
    if (at == std::string_view::npos) return std::nullopt;
    const char* last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data() + at + 1, last, value);
    if (error != std::errc{} || !(std::abs(value) < kLatestTime)) return std::nullopt;
    at = end == last ? std::string_view::npos : static_cast<std::size_t>(end - text.data());
  }
  return at == std::string_view::npos ? std::optional(values) : std::nullopt;
}

struct RecordedLeg {
  Leg leg;
  bool ended = false;
  std::vector<PositionSample> samples;
};

// The end names its leg whole: the beginning may be lost with a damaged part of the journal.
void end_leg(std::vector<RecordedLeg>& legs, const Leg& leg) {
  if (legs.empty() || legs.back().leg.accepted_s != leg.accepted_s) {
    RecordedLeg found{leg, true, {}};
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
  legs.back().ended = true;
}

std::vector<RecordedLeg> legs_in(const Journal& journal, bool& complete) {
  std::vector<RecordedLeg> legs;
  for (const JournalRecord& record : journal.of(JournalStream::event)) {
    const std::string text = record.text();
    if (text == kRunComplete) complete = true;
    if (text.starts_with("leg ")) {
      auto v = numbers_of<13>(text);
      if (!v) v = numbers_of<13>(text + " 0");  // before they held when the move was sent
      if (!v) continue;
      const auto& n = *v;
      if (n[1] < 1 || n[2] < 0 || n[2] > static_cast<int>(Phase::reposition)) continue;
      const Leg leg{static_cast<int>(std::min(n[1], 1e6)),
                    static_cast<Phase>(static_cast<int>(n[2])),
                    {n[3], n[4], n[5]},
                    {n[6], n[7], n[8]},
                    n[9],
                    n[10],
                    n[11],
                    n[12] > 0 ? n[12] : n[10]};
      if (n[0] == 0) {
        legs.push_back({leg, false, {}});
      } else {
        end_leg(legs, leg);
      }
    } else if (text.starts_with("at ") && !legs.empty()) {
      if (const auto v = numbers_of<5>(text)) {
        legs.back().samples.push_back({(*v)[0], (*v)[1], {(*v)[2], (*v)[3], (*v)[4]}});
      }
    }
  }
  return legs;
}

/// All frames of a journal, decoded and dated on the clock that the printer's positions have.
struct CollectedFrames {
  std::vector<float> signals;         // n x array.signals(), as Sensor::arrange()
  FrameTimeline clock;                // dates: n, when the sensor had finished each
  std::vector<std::uint8_t> suspect;  // n; 1: may be torn, or an implausible jump
  SensorDecoder::Counters decoder;

  std::size_t size() const { return clock.dates.size(); }
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
  all.decoder = decoder->counters();
  return all;
}

std::string doubt_of(const FrameTimeline& clock, const PositionTrack& track) {
  std::string doubt;
  if (!clock.plausible)
    doubt = "the board's clock says " + format(1e6 * clock.measured_s, 1) + " us a frame, the nominal " +
            format(1e6 * rig::kFramePeriodS, 0) + " are used; ";
  return doubt + track.doubt(kTrustedMm);
}

CollectedPass pass_of(const CollectedFrames& all, std::size_t signals, const PositionTrack& track,
                      double speed) {
  CollectedPass pass;
  std::uint64_t before = 0, last = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const FrameDate& date = all.clock.dates[i];
    const double time = date.time_s - 0.5 * all.clock.period_s;
    if (time < track.begin() || time > track.end()) continue;
    if (pass.time_s.empty() && pass.left_out == 0) before = date.missing;
    last = date.missing;
    const auto [at_s, p, head_mm] = track.at(time);
    // Where the head alone is doubted by more than that, the pass says so.
    if (date.doubt_s() * speed + (head_mm > kTrustedMm ? 0 : head_mm) > kTrustedMm) {
      ++pass.left_out;
      continue;
    }
    pass.time_s.push_back(time - track.begin());
    const auto frame = std::span(all.signals).subspan(i * signals, signals);
    pass.signals.insert(pass.signals.end(), frame.begin(), frame.end());
    pass.position.insert(pass.position.end(), {p.x, p.y, p.z});
    pass.suspect.push_back(all.suspect[i]);
  }
  pass.speed = speed;
  pass.measured_speed = track.speed();
  pass.doubt = doubt_of(all.clock, track);
  pass.missing = last - before;
  const std::uint64_t kept = pass.time_s.size(), made = kept + pass.left_out + pass.missing;
  if (static_cast<double>(kept) < 0.75 * static_cast<double>(made))
    pass.doubt += "only " + std::to_string(kept) + " of " + std::to_string(made) + " frames were kept; ";
  pass.doubt.resize(pass.doubt.size() - std::min<std::size_t>(2, pass.doubt.size()));
  return pass;
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
  const double exponent = std::floor(std::log10(measured)) - 2;
  return decimal(std::round(measured / decimal(1, exponent)), exponent);
}

Sensor sensor_of(const Journal& journal) { return part_of_header(journal, "sensor", sensor_of_json); }

Collection collection_of(const Journal& journal) {
  Collection collection;
  collection.header = journal.header;
  collection.torn_bytes = journal.torn_bytes;
  collection.lost_bytes = journal.lost_bytes;
  collection.lost_s = journal.lost_s;
  const std::vector<RecordedLeg> legs = legs_in(journal, collection.complete);
  collection.sensor = sensor_of(journal);
  collection.bed = part_of_header(journal, "bed", bed_of_json);
  CollectedFrames all = frames_in(journal, collection.sensor);
  std::vector<Leg> ended;
  for (const RecordedLeg& recorded : legs)
    if (recorded.ended) ended.push_back(recorded.leg);
  MoveTiming timing = timing_of(ended);
  for (const auto& [leg, over, samples] : legs)
    if (leg.speed > 0) timing.faster = std::max(timing.faster, fitted_speed(leg, samples) / leg.speed);
  collection.decoder = all.decoder;
  collection.frames = all.size();
  collection.missing = all.clock.missing;
  collection.resets = all.clock.resets;
  struct Parts {
    PositionTrack track;
    double speed = 0;
    bool complete = false;
    std::uint64_t positions = 0;
  };
  std::map<int, Parts> parts;
  for (const RecordedLeg& recorded : legs) {
    const Phase phase = recorded.leg.phase;
    if (phase != Phase::onset && phase != Phase::slide && phase != Phase::release) continue;
    Parts& part = parts[recorded.leg.pass];
    part.track.add_leg(recorded.leg, recorded.samples, timing);
    part.positions += recorded.samples.size();
    if (phase == Phase::slide) part.speed = recorded.leg.speed;
    if (phase == Phase::release) part.complete = recorded.ended;
  }
  for (const auto& [number, part] : parts) {
    CollectedPass pass = pass_of(all, collection.sensor.array.signals(), part.track, part.speed);
    pass.pass = number;
    pass.complete = part.complete;
    pass.positions = part.positions;
    pass.rejected_positions = part.track.rejected();
    collection.passes.push_back(std::move(pass));
  }
  all.clock.dates.clear();
  collection.clock = std::move(all.clock);
  return collection;
}

}  // namespace supertac
