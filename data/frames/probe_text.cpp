// Formats of text: columns of numbers, or objects of JSON.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "data/frames/probe.h"
#include "data/frames/sensor_decoder.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kClock = 0.25;  // how far the host's clock and the sensor's may differ in a probe
constexpr std::size_t kMostRestarts = 2, kStepsOfRestart = 20;  // noise falls far more often
constexpr double kRestarted = 0.3;      // of the time at least a clock runs that starts anew meanwhile
constexpr std::size_t kFewLines = 3;    // of which nothing can be said
constexpr std::size_t kManyLines = 30;  // a signal does not rise from each of them to the next

struct Lines {
  std::vector<std::string_view> text;
  double seconds = 0;  // from the first to the last
};

// Whole ones: the first and the last may be torn.
Lines lines_of(const std::string& bytes, double seconds) {
  Lines lines{.text = {}, .seconds = seconds};
  for (std::size_t at = bytes.find('\n'); at != std::string::npos;) {
    const std::size_t end = bytes.find('\n', at + 1);
    if (end == std::string::npos) break;
    const std::string_view line = std::string_view(bytes).substr(at + 1, end - at - 1);
    if (line.find_first_not_of(" \t\r") != std::string_view::npos) lines.text.push_back(line);
    at = end;
  }
  return lines;
}

bool from_printer(std::string_view line) {
  for (const char* begin : {"ok", "echo:", "Error:", "start", "//", "!!", "T:", "Grbl"})
    if (line.starts_with(begin)) return true;
  return false;
}

// From each value to the next.
struct Steps {
  double went = 0, longest = 0;  // upwards
  std::size_t fell = 0, rose = 0, by_one = 0;
};
Steps steps_of(std::span<const double> values) {
  Steps steps;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    if (step < 0) ++steps.fell;
    if (step == 1) ++steps.by_one;
    if (step > 0) ++steps.rose, steps.went += step, steps.longest = std::max(steps.longest, step);
  }
  return steps;
}

std::optional<FoundFormat> columns_of(const Lines& lines) {
  std::optional<FoundFormat> best;
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
    FoundFormat candidate;
    candidate.format = {.kind = FrameKind::text, .separator = separator};
    for (std::size_t c = 0; c < most; ++c) {
      const int column = static_cast<int>(c);
      const auto nan = std::ranges::count_if(columns[c], [](double v) { return std::isnan(v); });
      const auto unit = nan == 0 ? unit_of_clock(columns[c], lines.seconds) : std::nullopt;
      const Steps steps = steps_of(columns[c]);
      const bool counts_up = nan == 0 && steps.by_one + 1 == columns[c].size();
      const bool rises = nan == 0 && columns[c].size() >= kManyLines && steps.fell == 0 &&
                         2 * steps.rose > columns[c].size();
      if (unit && !candidate.format.time)
        candidate.format.time = FrameTime{.column = column, .unit_s = *unit};
      else if (static_cast<double>(nan) > 0.5 * static_cast<double>(columns[c].size()) || counts_up || rises)
        candidate.format.skip.push_back(column);
    }
    const std::size_t values = most - candidate.format.skip.size() - (candidate.format.time ? 1 : 0);
    const auto array = assumed_array(values);
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

std::optional<FoundFormat> objects_of(const Lines& lines) {
  std::map<std::string, std::vector<double>> scalars;
  std::vector<std::size_t> nested;
  FoundFormat candidate{.format = {.kind = FrameKind::json}, .array = {}, .remark = {}};
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
  const auto array = assumed_array(most, nested);
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

std::string shown(std::string_view line) {
  return in_quotes(line.substr(0, std::min<std::size_t>(line.size(), 60)));
}

}  // namespace

std::optional<TaxelArray> assumed_array(std::size_t values, std::span<const std::size_t> nested) {
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

std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds) {
  if (stamps.size() < kFewLines) return std::nullopt;
  // A clock may start anew while one listens, and stands still meanwhile; of what waited before one listened,
  // some may come first. Stamps of a clock that is coarser than the frames are the same for several.
  const auto [went, longest, fell, rose, by_one] = steps_of(stamps);
  if (fell > std::min(kMostRestarts, stamps.size() / kStepsOfRestart) || 2 * rose < stamps.size() - 1)
    return std::nullopt;
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

std::optional<FoundFormat> find_text_format(const std::string& bytes, double seconds,
                                            std::vector<std::string>& says) {
  const Lines lines = lines_of(bytes, seconds);
  if (lines.text.size() < kFewLines) {
    says.push_back(bytes.find('\n') == std::string::npos
                       ? "no line ends in this text: a sensor ends each frame with a line feed"
                       : "too few lines; probe for longer (--seconds)");
    return std::nullopt;
  }
  says.push_back(std::to_string(lines.text.size()) + " lines, such as " +
                 shown(lines.text[lines.text.size() / 2]));
  if (2 * static_cast<std::size_t>(std::ranges::count_if(lines.text, from_printer)) > lines.text.size()) {
    says.push_back("a printer's firmware answers here; choose the sensor's port (--list-ports)");
    return std::nullopt;
  }
  auto found = objects_of(lines);
  if (!found && 2 * std::ranges::count_if(lines.text, is_object) > std::ssize(lines.text)) {
    says.push_back(
        "objects of JSON without an array of numbers that makes rows and columns: the sensor has to send "
        "its taxels as one, such as {\"values\": [1, 2, 3, 4]}");
    return std::nullopt;
  }
  if (!found) found = columns_of(lines);
  if (!found)
    says.push_back(
        "a log, or words: no columns of numbers, and no JSON; choose the sensor's port, or its firmware");
  return found;
}

}  // namespace supertac
