#include "data/frames/probe.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "data/frames/sensor_decoder.h"
#include "data/sensors/touch_rests.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kMostly = 0.9, kText = 0.98;
constexpr double kPressed = 12;   // times the noise: more than that is a finger
constexpr double kUneven = 0.02;  // of the range: what signals may rest apart
constexpr double kAssumedHz = 100;

// Polarity, range, noise and what never moves; into the draft where they are known.
// What was known of a sensor stays where nothing says more than that.
void look_at_signals(Sensor& draft, const HeardFrames& frames, const std::optional<Sensor>& known,
                     std::vector<std::string>& says) {
  std::vector<double> noises, above, below;  // of each signal's median
  std::vector<int> still;
  bool whole = true;
  const auto channels = static_cast<std::size_t>(draft.array.channels);
  for (std::size_t k = 0; k < frames.signals.size(); ++k) {
    std::vector<float> values = frames.signals[k];
    std::vector<double> steps;
    for (std::size_t i = 1; i < values.size(); ++i)
      steps.push_back(std::abs(double{values[i]} - double{values[i - 1]}));
    whole = whole && std::ranges::all_of(values, [](float v) { return v == std::round(v); });
    const auto [low, high] = std::ranges::minmax(values);
    if (low == high && k % channels == 0) still.push_back(static_cast<int>(k / channels));
    const float middle = median(values);
    noises.push_back(steps.empty() ? 0 : quantile(steps, 0.75));
    above.push_back(double{high} - double{middle}), below.push_back(double{middle} - double{low});
  }
  // A taxel may be pressed for most of the time: the array as a whole says which way pressing goes.
  const bool upwards = std::reduce(above.begin(), above.end()) >= std::reduce(below.begin(), below.end());
  const std::vector<double> rests = rests_between_touches(frames.signals, draft.array.channels, upwards);
  double strongest = 0;
  std::vector<double> moving, sorted = rests;
  for (std::size_t k = 0; k < rests.size(); ++k) {
    const auto [low, high] = std::ranges::minmax(frames.signals[k]);
    if (low < high) moving.push_back(rests[k]);
    strongest = std::max(strongest, upwards ? double{high} - rests[k] : rests[k] - double{low});
  }
  const double rest = median(sorted), noise = std::max(median(noises), whole ? 1.0 : 1e-6 * std::abs(rest));
  const auto [lowest, highest] = std::ranges::minmax(rests);
  const double uneven = moving.empty() ? 0 : std::ranges::max(moving) - std::ranges::min(moving);
  draft.scale.unit = known ? known->scale.unit : whole ? "counts" : "unknown unit";
  says.push_back("at rest " + format(lowest) + " to " + format(highest) + ", median " + format(rest) +
                 ", noise " + format(noise, 3) + " from frame to frame" +
                 (known   ? ""
                  : whole ? "; whole numbers, called counts"
                          : "; set \"unit\""));
  const bool pressed = strongest > kPressed * noise, rises = upwards || !pressed;
  const double most = pressed ? 1.1 * strongest : std::max(20 * noise, 0.1 * std::abs(rest));
  if (known && !pressed) {
    draft.scale = known->scale;
  } else {
    draft.scale.rest = rest, draft.scale.span = rises ? -most : most;
  }
  if (pressed ? uneven > kUneven * most : known.has_value()) {
    draft.rest.assign(rests.begin(), rests.end());
    says.push_back("signals rest up to " + format(uneven, 3) +
                   " apart: \"rest\" moves each to the median; probe again when they have drifted");
  }
  says.push_back(pressed ? std::string("pressing ") + (rises ? "raises" : "lowers") +
                               " the signals, by up to " + format(strongest, 3)
                 : known
                     ? "nothing was pressed: \"pressed\" and \"range\" stay as the file has them"
                     : "nothing was pressed: \"pressed\": \"higher\" and the range are assumed; probe again "
                       "while you press");
  if (2 * still.size() > static_cast<std::size_t>(draft.array.taxels())) {
    says.push_back(std::to_string(still.size()) + " of " + std::to_string(draft.array.taxels()) +
                   " taxels did not change; press each of them while probing to find the dead ones");
  } else if (!still.empty()) {
    says.push_back("stuck or dead, since they never changed: taxels " + nlohmann::json(still).dump());
    for (const int taxel : still)
      if (std::ranges::find(draft.dead, taxel) == draft.dead.end()) draft.dead.push_back(taxel);
  }
}

// Says what it is where it is no sensor.
std::optional<FoundFormat> candidate_of(const std::string& bytes, std::span<const Heard> heard,
                                        const std::optional<Sensor>& known, std::vector<std::string>& says) {
  std::optional<FoundFormat> found;
  const double seconds = heard.empty() ? 0 : heard.back().time_s - heard.front().time_s;
  const auto text_bytes = std::ranges::count_if(bytes, [](char c) {
    return (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t' || c == '\x1B';
  });
  // UTF-16 has a NUL beside each character; some firmware sends one with each line.
  const auto nul = static_cast<double>(std::ranges::count(bytes, '\0')),
             all = static_cast<double>(bytes.size());
  const bool padded = nul < 0.1 * all || (nul > 0.45 * all && nul < 0.55 * all);
  if (bytes.empty()) {
    says.push_back(
        "nothing came: see whether the sensor is switched on, and whether address and baud rate are right");
  } else if (static_cast<double>(text_bytes) > kText * (padded ? all - nul : all)) {
    found = find_text_format(bytes, seconds, says);
  } else {
    const auto binary =
        find_binary_format(bytes, seconds, known ? std::optional(known->values()) : std::nullopt);
    const auto shape = binary ? assumed_array(binary->values) : std::nullopt;
    if (shape) found = FoundFormat{binary->format, *shape, "", {}};
    if (!found)
      says.push_back(
          "binary without a period: a wrong baud rate, a checksum or type that is not known, or no sensor");
  }
  return found;
}

}  // namespace

HeardFrames frames_of(const Sensor& sensor, std::span<const Heard> heard) {
  Sensor bare = sensor;
  bare.rest.clear(), bare.gain.clear();
  const auto decoder = make_decoder(sensor);
  HeardFrames frames;
  frames.signals.resize(sensor.array.signals());
  std::vector<float> signals(sensor.array.signals());
  double before = 0;
  for (const Heard& chunk : heard)
    decoder->push(std::as_bytes(std::span(chunk.bytes)), [&](const DecodedFrame& frame) {
      bare.arrange(frame.values, signals);
      if (!std::ranges::all_of(signals, [](float v) { return std::isfinite(v); })) return;
      const double time = frame.time_s.value_or(chunk.time_s);
      if (frames.count++ > 0 && time >= before) ++frames.steps, frames.seconds += time - before;
      before = time;
      for (std::size_t s = 0; s < signals.size(); ++s) frames.signals[s].push_back(signals[s]);
    });
  const auto counted = decoder->counters();
  frames.frame_bytes = static_cast<double>(counted.bytes - counted.discarded_bytes);
  return frames;
}

ProbeReport probe(std::span<const Heard> heard, const std::string& port, const std::optional<Sensor>& known) {
  ProbeReport report;
  std::string bytes;
  for (const Heard& chunk : heard) bytes += chunk.bytes;
  const double seconds = heard.empty() ? 0 : heard.back().time_s - heard.front().time_s;
  report.says.push_back("heard " + std::to_string(bytes.size()) + " bytes in " + format(seconds, 1) + " s");
  Sensor rig;
  rig.port = port;
  if (!bytes.empty() && frames_of(rig, heard).frame_bytes > kMostly * static_cast<double>(bytes.size())) {
    report.says.push_back("frames of the rig's board");
    report.draft = rig;
    return report;
  }
  // A description that reads what came knows more than what can be guessed.
  const bool reads = known && !bytes.empty() &&
                     frames_of(*known, heard).frame_bytes > kMostly * static_cast<double>(bytes.size());
  const auto found = reads ? std::optional(FoundFormat{known->frame, known->array, "", {}})
                           : candidate_of(bytes, heard, known, report.says);
  Sensor draft = known.value_or(Sensor{.name = "probed sensor", .body = {}});
  draft.port = port, draft.rest.clear();
  if (!found) return report;
  const std::size_t values = reads ? known->values() : found->array.signals();
  if (known && known->values() != values) {
    report.says.push_back("frames of " + std::to_string(values) + " values, expected the " +
                          std::to_string(known->values()) + " of " + known->array.text());
    return report;
  }
  draft.array = known ? known->array : found->array;
  draft.frame = found->format;
  if (!known) draft.dead = found->dead;
  const HeardFrames frames = frames_of(draft, heard);
  if (frames.count < 2 || frames.frame_bytes < 0.5 * static_cast<double>(bytes.size())) {
    report.says.push_back("only " + std::to_string(frames.count) +
                          " frames were whole; probe for longer (--seconds)");
    return report;
  }
  if (!found->remark.empty()) report.says.push_back(found->remark);
  const double rate = static_cast<double>(frames.steps) / std::max(frames.seconds, 1e-6);
  const bool unknown_rate = seconds < kAtOnceS && !draft.frame.time;
  draft.rate_hz = unknown_rate ? kAssumedHz : std::clamp(std::round(rate * 100) / 100, 1.0, 100'000.0);
  report.says.push_back("frames of " + std::to_string(values) + " values, " +
                        (unknown_rate ? "all at once" : format(draft.rate_hz) + " a second") +
                        (draft.frame.time
                             ? ", with a time stamp in " + format(draft.frame.time->unit_s) + " s"
                             : ", without a time stamp"));
  if (unknown_rate)
    report.says.push_back("assumed: " + format(kAssumedHz) + " frames a second; set \"rate_hz\"");
  if (!known)
    report.says.push_back("assumed: " + draft.array.text() +
                          "; set \"rows\", \"columns\", \"channels\" and \"pitch_mm\"");
  look_at_signals(draft, frames, known, report.says);
  draft.check();
  report.draft = draft;
  return report;
}

}  // namespace supertac
