#include "hardware/boards/probe.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "hardware/boards/sensor_decoder.h"
#include "io/files/json.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kMostly = 0.9, kText = 0.98;
constexpr double kClock = 0.25;  // how far the host's clock and the sensor's may differ in a probe
constexpr std::size_t kMostRestarts = 2, kStepsOfRestart = 20;  // noise falls far more often
constexpr double kRestarted = 0.3;  // of the time at least a clock runs that starts anew meanwhile
constexpr double kPressed = 12;     // times the noise: more than that is a finger
constexpr double kUneven = 0.02;    // of the range: what signals may rest apart
constexpr double kAtOnceS = 0.2, kAssumedHz = 100;
constexpr std::size_t kFewLines = 3;    // of which nothing can be said
constexpr std::size_t kManyLines = 30;  // a signal does not rise from each of them to the next

struct Lines {
  std::vector<std::string_view> text;
  double seconds = 0;  // from the first to the last
};

// Whole ones: the first and the last may be torn.
Lines lines_of(const std::string& bytes, std::span<const Heard> heard) {
  Lines lines;
  for (std::size_t at = bytes.find('\n'); at != std::string::npos;) {
    const std::size_t end = bytes.find('\n', at + 1);
    if (end == std::string::npos) break;
    const std::string_view line = std::string_view(bytes).substr(at + 1, end - at - 1);
    if (line.find_first_not_of(" \t\r") != std::string_view::npos) lines.text.push_back(line);
    at = end;
  }
  if (!heard.empty()) lines.seconds = heard.back().time_s - heard.front().time_s;
  return lines;
}

bool from_printer(std::string_view line) {
  for (const char* begin : {"ok", "echo:", "Error:", "start", "//", "!!", "T:", "Grbl"})
    if (line.starts_with(begin)) return true;
  return false;
}

// A format in question, and the array that its frames are.
struct Candidate {
  FrameFormat format;
  TaxelArray array;
  std::string remark;
};

// rows x columns, or with three channels; nothing when no array has so many.
std::optional<TaxelArray> array_of(std::size_t values, std::vector<std::size_t> nested) {
  const auto fits = [](std::size_t n) { return n >= 1 && n <= 64; };
  const auto side = [](std::size_t n) { return static_cast<int>(n); };
  if (nested.size() == 3 && fits(nested[0]) && fits(nested[1]) && nested[2] <= 8)
    return TaxelArray{.rows = side(nested[0]), .columns = side(nested[1]), .channels = side(nested[2])};
  const bool axes = nested.size() == 2 && nested[1] == 3;
  if (nested.size() == 2 && !axes && fits(nested[0]) && fits(nested[1]))
    return TaxelArray{.rows = side(nested[0]), .columns = side(nested[1])};
  const std::size_t taxels = axes ? nested[0] : values;
  for (auto rows = static_cast<std::size_t>(std::sqrt(static_cast<double>(taxels))); rows >= 1; --rows)
    if (taxels % rows == 0 && fits(rows) && fits(taxels / rows))
      return TaxelArray{.rows = side(rows), .columns = side(taxels / rows), .channels = axes ? 3 : 1};
  return std::nullopt;
}

std::optional<Candidate> columns_of(const Lines& lines) {
  std::optional<Candidate> best;
  std::size_t most = 1;
  for (const char separator : {',', ';', '\t', '|', ' '}) {
    std::map<std::size_t, std::size_t> counts;
    for (const auto line : lines.text) ++counts[split_line(line, separator).size()];
    const auto usual = std::ranges::max_element(counts, {}, [](const auto& entry) { return entry.second; });
    if (usual->first <= most ||
        static_cast<double>(usual->second) < 0.5 * static_cast<double>(lines.text.size()))
      continue;
    most = usual->first;
    std::vector<std::vector<double>> columns(most);
    for (const auto line : lines.text) {
      const auto texts = split_line(line, separator);
      if (texts.size() != most) continue;
      for (std::size_t c = 0; c < most; ++c)
        columns[c].push_back(number_of(texts[c]).value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    Candidate candidate;
    candidate.format = {.kind = FrameKind::text, .separator = separator};
    for (std::size_t c = 0; c < most; ++c) {
      const int column = static_cast<int>(c);
      const auto nan = std::ranges::count_if(columns[c], [](double v) { return std::isnan(v); });
      const auto unit = nan == 0 ? unit_of_clock(columns[c], lines.seconds) : std::nullopt;
      bool counts_up = nan == 0, falls = nan > 0 || columns[c].size() < kManyLines;
      std::size_t risen = 0;
      for (std::size_t i = 1; i < columns[c].size(); ++i) {
        const double step = columns[c][i] - columns[c][i - 1];
        counts_up = counts_up && step == 1, falls = falls || step<0, risen += step> 0 ? 1 : 0;
      }
      const bool rises = !falls && 2 * risen > columns[c].size();
      if (unit && !candidate.format.time)
        candidate.format.time = FrameTime{.column = column, .unit_s = *unit};
      else if (static_cast<double>(nan) > 0.5 * static_cast<double>(columns[c].size()) || counts_up || rises)
        candidate.format.skip.push_back(column);
    }
    const std::size_t values = most - candidate.format.skip.size() - (candidate.format.time ? 1 : 0);
    const auto array = array_of(values, {});
    if (!array) continue;
    candidate.array = *array;
    if (!candidate.format.skip.empty())
      candidate.remark =
          "columns that are no signal (words, a counter, a clock of no known unit) are skipped: " +
          nlohmann::json(candidate.format.skip).dump();
    best = candidate;
  }
  return best;
}

void sizes_of(const nlohmann::ordered_json& json, std::vector<std::size_t>& nested) {
  if (!json.is_array() || json.empty()) return;
  nested.push_back(json.size());
  sizes_of(json.front(), nested);
}

std::optional<Candidate> objects_of(const Lines& lines) {
  std::map<std::string, std::vector<double>> scalars;
  std::vector<std::size_t> nested;
  Candidate candidate{.format = {.kind = FrameKind::json}, .array = {}, .remark = {}};
  std::size_t most = 0, parsed = 0;
  using Pointer = nlohmann::ordered_json::json_pointer;
  const std::function<void(const Pointer&, const nlohmann::ordered_json&)> look =
      [&](const Pointer& place, const nlohmann::ordered_json& value) {
        if (value.is_object())
          for (const auto& [inner, of] : value.items()) look(place / inner, of);
        const bool outermost = !place.empty() && place.parent_pointer().empty();
        const std::string key =
            outermost && !place.back().starts_with('/') ? place.back() : place.to_string();
        std::vector<float> numbers;
        if (value.is_number()) scalars[key].push_back(value.get<double>());
        if (!value.is_array() || !flatten(value, numbers) || numbers.size() <= most) return;
        most = numbers.size(), candidate.format.values = key, nested.clear();
        sizes_of(value, nested);
      };
  for (const auto line : lines.text) try {
      const auto json = parse_json_limited(line);
      if (json.is_structured()) look(Pointer(), json);
      ++parsed;
    } catch (const JsonError&) {  // no line of this kind
    }
  if (static_cast<double>(parsed) < 0.5 * static_cast<double>(lines.text.size()) || most == 0)
    return std::nullopt;
  const auto array = array_of(most, nested);
  if (!array) return std::nullopt;
  candidate.array = *array;
  // The clock beside the array rather than another.
  const auto folder = [](const std::string& key) { return key.substr(0, key.rfind('/') + 1); };
  for (const auto& [key, stamps] : scalars) {
    const auto unit = stamps.size() == parsed ? unit_of_clock(stamps, lines.seconds) : std::nullopt;
    const bool beside = folder(key) == folder(candidate.format.values);
    if (!unit || (candidate.format.time &&
                  (!beside || folder(candidate.format.time->key) == folder(candidate.format.values))))
      continue;
    candidate.format.time = FrameTime{.key = key, .unit_s = *unit};
  }
  return candidate;
}

bool is_object(std::string_view line) {
  try {
    return parse_json_limited(line).is_object();
  } catch (const JsonError&) {
    return false;
  }
}

// Polarity, range, noise and what never moves; into the draft where they are known.
// What was known of a sensor stays where nothing says more than that.
void look_at_signals(Sensor& draft, const HeardFrames& frames, const std::optional<Sensor>& known,
                     std::vector<std::string>& says) {
  std::vector<double> rests, moving, noises;
  std::vector<int> still;
  double up = 0, down = 0;
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
    const double rest = double{median(values)};
    if (low < high) moving.push_back(rest);
    rests.push_back(rest), noises.push_back(steps.empty() ? 0 : quantile(steps, 0.75));
    up = std::max(up, double{high} - rest), down = std::max(down, rest - double{low});
  }
  std::vector<double> sorted = rests;
  const double rest = median(sorted), noise = std::max(median(noises), whole ? 1.0 : 1e-6 * std::abs(rest));
  const auto [lowest, highest] = std::ranges::minmax(rests);
  const double uneven = moving.empty() ? 0 : std::ranges::max(moving) - std::ranges::min(moving);
  draft.scale.unit = known ? known->scale.unit : whole ? "counts" : "unknown unit";
  says.push_back("at rest " + format(lowest) + " to " + format(highest) + ", median " + format(rest) +
                 ", noise " + format(noise, 3) + " from frame to frame" +
                 (known   ? ""
                  : whole ? "; whole numbers, called counts"
                          : "; set \"unit\""));
  const bool pressed = std::max(up, down) > kPressed * noise, rises = up >= down || !pressed;
  const double most = pressed ? 1.1 * std::max(up, down) : std::max(20 * noise, 0.1 * std::abs(rest));
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
                               " the signals, by up to " + format(std::max(up, down), 3)
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

std::string shown(std::string_view line) {
  return in_quotes(line.substr(0, std::min<std::size_t>(line.size(), 60)));
}

// Says what it is where it is no sensor.
std::optional<Candidate> candidate_of(const std::string& bytes, std::span<const Heard> heard,
                                      const std::optional<Sensor>& known, std::vector<std::string>& says) {
  std::optional<Candidate> found;
  const auto text_bytes = std::ranges::count_if(
      bytes, [](char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t'; });
  if (bytes.empty()) {
    says.push_back(
        "nothing came: see whether the sensor is switched on, and whether address and baud rate are right");
  } else if (static_cast<double>(text_bytes) > kText * static_cast<double>(bytes.size())) {
    const Lines lines = lines_of(bytes, heard);
    if (lines.text.size() < kFewLines) {
      says.push_back(bytes.find('\n') == std::string::npos
                         ? "no line ends in this text: a sensor ends each frame with a line feed"
                         : "too few lines; probe for longer (--seconds)");
      return found;
    }
    says.push_back(std::to_string(lines.text.size()) + " lines, such as " +
                   shown(lines.text[lines.text.size() / 2]));
    if (2 * static_cast<std::size_t>(std::ranges::count_if(lines.text, from_printer)) > lines.text.size()) {
      says.push_back("a printer's firmware answers here; choose the sensor's port (--list-ports)");
      return found;
    }
    found = objects_of(lines);
    if (!found && 2 * std::ranges::count_if(lines.text, is_object) > std::ssize(lines.text)) {
      says.push_back(
          "objects of JSON without an array of numbers that makes rows and columns: the sensor has to send "
          "its taxels as one, "
          "such as {\"values\": [1, 2, 3, 4]}");
      return found;
    }
    if (!found) found = columns_of(lines);
    if (!found)
      says.push_back(
          "a log, or words: no columns of numbers, and no JSON; choose the sensor's port, or its firmware");
  } else {
    const auto binary = find_binary_format(bytes, heard.back().time_s - heard.front().time_s,
                                           known ? std::optional(known->values()) : std::nullopt);
    const auto shape = binary ? array_of(binary->values, {}) : std::nullopt;
    if (shape) found = Candidate{binary->format, *shape, ""};
    if (!found)
      says.push_back(
          "binary without a period: a wrong baud rate, a checksum or type that is not known, or no sensor");
  }
  return found;
}

}  // namespace

std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds) {
  if (stamps.size() < kFewLines) return std::nullopt;
  // A clock may start anew while one listens, and stands still meanwhile; of what waited before one listened,
  // some may come first.
  // Stamps of a clock that is coarser than the frames are the same for several.
  double went = 0, longest = 0;
  std::size_t fell = 0, rose = 0;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const double step = stamps[i] - stamps[i - 1];
    if (step < 0 && ++fell > std::min(kMostRestarts, stamps.size() / kStepsOfRestart)) return std::nullopt;
    if (step > 0) ++rose, went += step, longest = std::max(longest, step);
  }
  if (2 * rose < stamps.size() - 1) return std::nullopt;
  if (seconds < kAtOnceS) {  // a file says nothing of the time it took: a clock of milliseconds, or a counter
    const bool whole = std::ranges::all_of(stamps, [](double v) { return v == std::round(v); });
    if (fell > 0 || went == static_cast<double>(stamps.size() - 1)) return std::nullopt;
    return whole ? 1e-3 : 1;
  }
  for (const double jump : {0.0, longest})
    for (const double unit : {1.0, 1e-3, 1e-6}) {
      const double ratio = (went - jump) * unit / seconds;
      if (ratio > (fell > 0 ? kRestarted : 1 - kClock) && ratio < 1 + kClock) return unit;
    }
  return std::nullopt;
}

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
  Sensor draft;  // the rig, until then
  draft.port = port;
  if (!bytes.empty() && frames_of(draft, heard).frame_bytes > kMostly * static_cast<double>(bytes.size())) {
    report.says.push_back("frames of the rig's board");
    report.draft = draft;
    return report;
  }
  // A description that reads what came knows more than what can be guessed.
  const bool reads = known && !bytes.empty() &&
                     frames_of(*known, heard).frame_bytes > kMostly * static_cast<double>(bytes.size());
  const auto found = reads ? std::optional(Candidate{known->frame, known->array, ""})
                           : candidate_of(bytes, heard, known, report.says);
  draft.name = "probed sensor";
  if (known) draft.name = known->name, draft.order = known->order;
  if (known) draft.dead = known->dead, draft.gain = known->gain, draft.follow_rest_s = known->follow_rest_s;
  if (!found) return report;
  const std::size_t values = reads ? known->values() : found->array.signals();
  if (known && known->values() != values) {
    report.says.push_back("frames of " + std::to_string(values) + " values, expected the " +
                          std::to_string(known->values()) + " of " + known->array.text());
    return report;
  }
  draft.array = known ? known->array : found->array;
  draft.frame = found->format;
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
