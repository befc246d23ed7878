// Formats of text: columns of numbers, or objects of JSON.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "data/frames/probe.h"
#include "data/frames/sensor_decoder.h"
#include "data/frames/text_grammar.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

bool from_printer(std::string_view line) {
  for (const char* begin : {"ok", "echo:", "Error:", "start", "//", "!!", "T:", "Grbl"})
    if (line.starts_with(begin)) return true;
  return false;
}

// A list of slots as "0 to 3, 7".
std::string places(const std::vector<int>& slots) {
  std::string text;
  for (std::size_t i = 0; i < slots.size();) {
    std::size_t end = i + 1;
    while (end < slots.size() && slots[end] == slots[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ", ") + std::to_string(slots[i]) +
            (end - i > 1 ? " to " + std::to_string(slots[end - 1]) : "");
    i = end;
  }
  return text;
}

// Every slot's role is said; time and skip are written from them.
std::optional<FoundFormat> found_by_roles(TextGrammar& grammar, double seconds,
                                          std::vector<std::string>& says) {
  constexpr const char* kNames[] = {"signal", "clock", "counter", "checksum", "signal that never changes",
                                    "label",  "words", "no taxel"};  // by SlotRole::Kind
  find_roles(grammar, seconds);
  FoundFormat found{.format = grammar.format, .array = {}, .remark = {}};
  std::vector<std::pair<std::string, std::vector<int>>> said;
  std::size_t values = 0;
  std::map<std::size_t, std::size_t> rows;  // the values in each line of a frame
  for (int column = 0; column < std::ssize(grammar.slots); ++column) {
    const FoundSlot& slot = grammar.slots[static_cast<std::size_t>(column)];
    const SlotRole& role = slot.role;
    if (role.kind == SlotRole::clock && role.unit_s > 0 && !found.format.time)
      found.format.time = FrameTime{.column = column, .unit_s = role.unit_s};
    else if (role.kind != SlotRole::signal && role.kind != SlotRole::constant)
      found.format.skip.push_back(column);
    else if (++values, ++rows[slot.line];
             std::ranges::all_of(slot.column, [](double v) { return std::isnan(v); }))
      found.dead.push_back(static_cast<int>(values) - 1);
    const std::string what = std::string(kNames[role.kind]) + ": " + role.why;
    const auto known = std::ranges::find(said, what, [](const auto& s) { return s.first; });
    (known == said.end() ? said.emplace_back(what, std::vector<int>{}) : *known).second.push_back(column);
  }
  says.insert(says.end(), grammar.says.begin(), grammar.says.end());
  for (const auto& [what, columns] : said)
    says.push_back((columns.size() > 1 ? "slots " : "slot ") + places(columns) + ": " + what);
  const auto channels = static_cast<std::size_t>(grammar.channels);
  auto array = values == 0 ? std::nullopt : assumed_array(values / channels);
  if (array) array->channels = grammar.channels;
  if (!grammar.doubt.empty()) {
    says.push_back("two readings explain this alike: " + grammar.doubt +
                   "; no draft is written: give the sensor's file, with \"lines_per_frame\" and \"skip\"");
    return std::nullopt;
  }
  if (!array) return std::nullopt;
  found.array = *array;
  std::size_t longest = 0;
  for (const auto& [line, count] : rows) longest = std::max(longest, count);
  if (rows.size() > 1 && rows.size() <= 64 && longest > 1 && longest <= 64 && longest * rows.size() == values)
    found.array = {.rows = static_cast<int>(rows.size()), .columns = static_cast<int>(longest)};
  if (grammar.format.lines_per_frame > 1)
    found.remark = "a frame is " + std::to_string(grammar.format.lines_per_frame) + " lines, " +
                   (grammar.format.prefix.empty() ? "behind an empty line"
                                                  : "the first begins " + in_quotes(grammar.format.prefix));
  if (!found.format.skip.empty()) {
    if (!found.remark.empty()) found.remark += "; ";
    found.remark += "columns that are no signal (words, a counter, a clock of no known unit) are skipped: " +
                    nlohmann::json(found.format.skip).dump();
  }
  return found;
}

void sizes_of(const nlohmann::ordered_json& json, std::vector<std::size_t>& nested) {
  if (!json.is_array() || json.empty()) return;
  nested.push_back(json.size());
  sizes_of(json.front(), nested);
}

// Counts the lines that are `objects`.
std::optional<FoundFormat> objects_of(const std::vector<std::string>& lines, double seconds,
                                      std::size_t& objects, std::vector<std::string>& says) {
  std::map<std::string, std::vector<double>> scalars;
  std::map<std::string, std::vector<std::vector<float>>> arrays;
  std::vector<std::size_t> nested;
  FoundFormat found{.format = {.kind = FrameKind::json}, .array = {}, .remark = {}};
  std::string& values = found.format.values;
  std::size_t most = 0, parsed = 0, stamped = 0;
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
        if (!value.is_array() || !flatten(value, numbers)) return;
        if (numbers.size() > most) {
          most = numbers.size(), values = key, nested.clear();
          sizes_of(value, nested);
        }
        arrays[key].push_back(std::move(numbers));
      };
  for (const std::string& line : lines) try {
      const std::string_view content = behind_stamp(line);
      const auto json = parse_json_limited(content);
      if (json.is_structured()) look(Pointer(), json);
      stamped += content.size() < line.size(), objects += json.is_object();
      ++parsed;
    } catch (const JsonError&) {  // no line of this kind
    }
  // Of a bare array behind a time of day the columns tell more.
  if (2 * parsed < lines.size() || most == 0 || (values.empty() && 2 * stamped > parsed)) return std::nullopt;
  const auto folder = [](const std::string& key) { return key.substr(0, key.rfind('/') + 1); };
  if (nested.size() == 1) {  // the places of a flat array are slots as well
    TextGrammar grammar{
        .format = found.format, .slots = std::vector<FoundSlot>(most), .says = {}, .doubt = {}};
    for (const std::vector<float>& frame : arrays[values])
      for (std::size_t c = 0; c < most && frame.size() == most; ++c) {
        grammar.slots[c].column.push_back(double{frame[c]});
        if (frame[c] != std::round(frame[c])) grammar.slots[c].decimals = 1;
      }
    const auto by_roles = found_by_roles(grammar, seconds, says);
    if (!by_roles) return std::nullopt;
    found = *by_roles;
    if (std::optional<FrameTime>& time = found.format.time) {
      time->key = (values.empty() || values.starts_with('/') ? values : "/" + values) + "/" +
                  std::to_string(time->column);
      found.format.skip.push_back(std::exchange(time->column, 0));
    }
  } else if (const auto array = assumed_array(most, nested)) {
    found.array = *array;
  } else {
    return std::nullopt;
  }
  // The clock beside the array rather than another.
  for (const auto& [key, stamps] : scalars) {
    const auto unit = stamps.size() == parsed ? unit_of_clock(stamps, seconds) : std::nullopt;
    const bool beside = folder(key) == folder(values);
    if (unit && (!found.format.time || (beside && folder(found.format.time->key) != folder(values))))
      found.format.time = FrameTime{.key = key, .unit_s = *unit};
  }
  return found;
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

std::optional<FoundFormat> find_text_format(const std::string& bytes, double seconds,
                                            std::vector<std::string>& says) {
  std::vector<std::string> raw, lines;  // whole ones; the first may be torn, or name what follows
  for (std::size_t at = 0, end; (end = bytes.find('\n', at)) != std::string::npos; at = end + 1) {
    raw.push_back(bytes.substr(at, end - at));
    if (std::string clean = clean_line(raw.back()); !clean.empty()) lines.push_back(std::move(clean));
  }
  if (lines.size() < 3) {
    says.push_back(raw.empty() ? "no line ends in this text: a sensor ends each frame with a line feed"
                               : "too few lines; probe for longer (--seconds)");
    return std::nullopt;
  }
  says.push_back(std::to_string(lines.size()) + " lines, such as " +
                 in_quotes(lines[lines.size() / 2].substr(0, 60)));
  if (2 * std::ranges::count_if(lines, from_printer) > std::ssize(lines)) {
    says.push_back("a printer's firmware answers here; choose the sensor's port (supertac-check machine)");
    return std::nullopt;
  }
  const std::size_t before = says.size();
  std::size_t objects = 0;
  auto found = objects_of(lines, seconds, objects, says);
  if (!found && 2 * objects > lines.size()) {
    says.push_back(
        "objects of JSON without an array of numbers that makes rows and columns: the sensor has to send "
        "its taxels as one, such as {\"values\": [1, 2, 3, 4]}");
    return std::nullopt;
  }
  if (auto grammar = found ? std::nullopt : find_grammar(raw))
    found = found_by_roles(*grammar, seconds, says);
  if (!found && says.size() == before)
    says.push_back(
        "a log, or words: no columns of numbers, and no JSON; choose the sensor's port, or its firmware");
  return found;
}

}  // namespace supertac
