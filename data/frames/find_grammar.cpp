// Reading and period of lines.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "data/frames/binary_decoder.h"
#include "data/frames/text_grammar.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kRowsDiffer =
    0.7;  // of the variance of all: what stays within the rows, where rows are taxels

struct Reading {
  char separator;
  std::size_t slots = 0, numbers = 0;  // of the usual line: cells or numbers; of these no words
  double share = 0;                    // of the lines, weighted by their length, that are such
};

Reading read_as(const std::vector<std::string>& lines, char separator, char decimal) {
  std::map<std::pair<std::size_t, std::size_t>, double> counts;
  double all = 0;
  for (const std::string& line : lines) {
    const auto slots = slots_of(line, separator, decimal);
    const auto numbers =
        slots.size() - static_cast<std::size_t>(std::ranges::count_if(slots, &TextSlot::words));
    if (numbers == 0) continue;
    counts[{slots.size(), numbers}] += static_cast<double>(numbers);
    all += static_cast<double>(numbers);
  }
  Reading reading{.separator = separator};
  if (counts.empty()) return reading;
  const auto usual = std::ranges::max_element(counts, {}, [](const auto& c) { return c.second; });
  reading.slots = usual->first.first, reading.numbers = usual->first.second,
  reading.share = usual->second / all;
  return reading;
}

struct Kind {
  std::string begins;     // the template before the first number
  std::size_t count = 0;  // of numbers
  auto operator<=>(const Kind&) const = default;
};

/// The distance from each line of a kind to the next, where most have the same.
std::optional<std::size_t> usual_gap(const std::vector<std::size_t>& places) {
  if (places.size() < 3) return std::nullopt;
  std::map<std::size_t, std::size_t> gaps;
  for (std::size_t i = 1; i < places.size(); ++i) ++gaps[places[i] - places[i - 1]];
  const auto usual = std::ranges::max_element(gaps, {}, [](const auto& g) { return g.second; });
  if (static_cast<double>(usual->second) < 0.7 * static_cast<double>(places.size() - 1)) return std::nullopt;
  return usual->first;
}

/// The share of the variance of each column that is left within the lines of one place in the period.
double within_rows(const std::vector<std::vector<double>>& rows, std::size_t period, std::size_t first) {
  struct Sums {
    double sum = 0, squares = 0, count = 0;
    void add(double v) { sum += v, squares += v * v, ++count; }
    double variance() const { return count > 0 ? squares - sum * sum / count : 0; }
  };
  std::map<std::size_t, Sums> all;
  std::map<std::pair<std::size_t, std::size_t>, Sums> places;
  for (std::size_t i = first; i < rows.size(); ++i)
    for (std::size_t c = 0; c < rows[i].size(); ++c)
      if (std::isfinite(rows[i][c]))
        all[c].add(rows[i][c]), places[{(i - first) % period, c}].add(rows[i][c]);
  double within = 0, total = 0;
  for (const auto& [c, sums] : all) total += sums.variance();
  for (const auto& [place, sums] : places) within += sums.variance();
  return total > 0 ? within / total : 1;
}

/// Numbers rise from line to line and do not begin anew: each line is a frame of its own. A `nan` between two
/// numbers hides no fall.
bool has_own_clock(const std::vector<std::vector<double>>& rows) {
  if (rows.size() < 4) return false;
  for (std::size_t c = 0; c < rows[0].size(); ++c) {
    std::size_t rose = 0, fell = 0;
    double before = rows[0][c];
    for (const std::vector<double>& row : rows) {
      rose += row[c] > before, fell += row[c] < before;
      if (!std::isnan(row[c])) before = row[c];
    }
    if (10 * rose > 3 * rows.size() && 50 * fell <= rows.size()) return true;
  }
  return false;
}

/// Lines as their kinds (of empty ones in a row the first), and those with the usual count of numbers.
struct Survey {
  std::vector<Kind> kinds;
  std::size_t usual = 0;
  std::vector<std::vector<double>> rows;  // of the usual lines, all numbers
  std::vector<std::string> starts;        // of these, up to the first number and what is behind it
  bool own = false;                       // each is a frame of its own
};

Survey survey_of(const std::vector<std::string>& lines, char decimal) {
  Survey survey;
  std::map<std::size_t, std::size_t> counts;
  std::vector<std::vector<TextSlot>> all;
  for (const std::string& line : lines)
    ++counts[all.emplace_back(slots_of(behind_stamp(line), 0, decimal)).size()];
  std::size_t most = 0;
  for (const auto& [count, of] : counts)
    if (count * of > most) most = count * of, survey.usual = count;
  bool stamped = true;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string& line = lines[i];
    const std::vector<TextSlot>& slots = all[i];
    const std::string_view content = behind_stamp(line);
    if (content.empty()) {
      if (survey.kinds.empty() || survey.kinds.back() != Kind{}) survey.kinds.emplace_back();
      continue;
    }
    const std::size_t first = slots.empty() ? content.size() : slots[0].text.data() - content.data();
    survey.kinds.push_back({std::string(trimmed(content.substr(0, first))), slots.size()});
    if (slots.empty() || slots.size() != survey.usual) continue;
    stamped = stamped && content.size() != line.size() && line.find("->") == std::string::npos;
    survey.starts.emplace_back(content.substr(0, first + slots[0].text.size() + 1));
    survey.rows.emplace_back();
    for (const TextSlot& slot : slots) survey.rows.back().push_back(slot.value);
  }
  survey.own = (stamped && !survey.rows.empty()) || has_own_clock(survey.rows);
  return survey;
}

/// Fills lines_per_frame and prefix where kinds of lines take turns; false where nothing is settled so.
bool find_turns(const Survey& survey, TextGrammar& grammar) {
  const std::vector<Kind>& kinds = survey.kinds;
  std::map<Kind, std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < kinds.size(); ++i) places[kinds[i]].push_back(i);
  std::size_t period = 1;
  for (const auto& [kind, of] : places)
    if (const auto gap = usual_gap(of);
        gap && *gap > period && *gap <= 300 &&
        static_cast<double>(of.size() * *gap) > 0.6 * static_cast<double>(kinds.size()))
      period = *gap;
  std::vector<Kind> anchors;
  for (const auto& [kind, of] : places)
    if (period > 1 && usual_gap(of) == period && 2 * of.size() * period > kinds.size())
      anchors.push_back(kind);
  if (anchors.empty()) return false;
  if (std::ranges::find(anchors, Kind{}) != anchors.end()) {
    grammar.format.lines_per_frame = static_cast<int>(period) - 1;
    return true;
  }
  // A line unlike the others begins a frame; else the first label.
  const auto natural = [](const Kind& kind) {
    const std::size_t number = std::min(kind.begins.find_first_of("0123456789"), kind.begins.size());
    const std::string digits =
        kind.begins.substr(number, kind.begins.find_first_not_of("0123456789", number) - number);
    return std::tuple(kind.count, kind.begins.substr(0, number), parse_double(digits).value_or(0),
                      kind.begins);
  };
  std::vector<Kind> odd;
  for (const Kind& kind : anchors)
    if (kind.count != survey.usual && !kind.begins.empty()) odd.push_back(kind);
  const Kind first = odd.size() == 1 ? odd[0] : *std::ranges::min_element(anchors, {}, natural);
  if (first.begins.empty()) {
    grammar.doubt = std::to_string(period) + " kinds of lines take turns, with " +
                    joined(anchors, " and ", [](const Kind& kind) { return std::to_string(kind.count); }) +
                    " numbers, and no mark says where a frame begins: they may be one quantity or several";
    return false;
  }
  if (odd.size() == 1 && odd[0].count == 0 && period > 2) {
    const double within = within_rows(survey.rows, period - 1, 0);
    if (within > 0.9) return true;  // of the variance: a remark now and then
    if (within > kRowsDiffer)
      grammar.doubt = "a line " + in_quotes(first.begins) + " after every " + std::to_string(period - 1) +
                      " lines, which do not differ: each line may be a frame, or all of them one";
  }
  grammar.format.lines_per_frame = static_cast<int>(period), grammar.format.prefix = first.begins;
  return true;
}

/// The same where the first number of a line counts the rows of a frame; it may count the frames.
void find_index(const Survey& survey, TextGrammar& grammar) {
  const std::vector<std::vector<double>>& rows = survey.rows;
  if (survey.usual < 2 || rows.size() < 6) return;
  std::vector<double> index;
  for (const auto& row : rows) index.push_back(row[0]);
  const double low = std::ranges::min(index), high = std::ranges::max(index);
  const double size = high - low + 1;
  if (low != 0 && low != 1) return;
  if (!(size >= 2 && size <= 64 && static_cast<double>(rows.size()) >= 3 * size)) return;
  std::size_t steps = 0;
  for (std::size_t i = 1; i < index.size(); ++i)
    steps += index[i] == (index[i - 1] == high ? low : index[i - 1] + 1);
  if (10 * steps < 8 * index.size()) return;
  std::vector<std::vector<double>> values(rows.size());
  std::size_t first = 0;
  while (index[first] != low) ++first;
  for (std::size_t i = 0; i < rows.size(); ++i) values[i].assign(rows[i].begin() + 1, rows[i].end());
  const double within = within_rows(values, static_cast<std::size_t>(size), first);
  const std::string what =
      "the first number of a line runs from " + format(low) + " to " + format(high) + ", ";
  const bool named = survey.starts[first].find("ow") != std::string::npos;
  if (!named && survey.usual > 2 && within > kRowsDiffer)
    grammar.doubt =
        what +
        "but what follows does not differ between them: it may be a counter of frames that are a line each, "
        "or the row of a frame of " +
        format(size) + " lines";
  grammar.format.lines_per_frame = static_cast<int>(size);
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (index[i] == low) grammar.format.prefix = trimmed(survey.starts[i]);
  grammar.says.push_back(what + "so a frame has " + format(size) + " lines, each with its row");
}

/// Whether most lines end in a hexadecimal checksum, and in which.
std::string find_checksum(const std::vector<std::string>& lines) {
  std::size_t with = 0, hex = 0, all = 0;
  std::map<std::string, std::size_t> fits;
  std::set<unsigned> seen;
  for (const std::string& line : lines) {
    if (line.empty()) continue;
    ++all;
    const auto sum = checksum_of(line);
    if (!sum) continue;
    ++with, seen.insert(sum->stated);
    const std::string_view text = std::string_view(line).substr(sum->line.size() + 1);
    hex += line[sum->line.size()] == '*' || text.find_first_of("abcdefABCDEF") != std::string_view::npos;
    for (const char* kind : kChecksums)
      if (sum->digits == 2 * checksum_bytes(kind)) fits[kind] += sum->computed(kind) == sum->stated;
  }
  if (4 * with < 3 * all || seen.size() < 3) return "none";
  for (const auto& [kind, count] : fits)
    if (10 * count > 8 * with) return kind;
  return 5 * hex > with ? "hex" : "none";
}

void say_what_was_taken_away(const std::vector<std::string>& raw, TextGrammar& grammar) {
  const auto has = [&](std::string_view mark) {
    return std::ranges::any_of(raw, [&](const auto& line) { return line.find(mark) != std::string::npos; });
  };
  const bool wide = has("\xFF\xFE") || has("\xFE\xFF");
  std::vector<std::string> what;
  if (wide) what.emplace_back("UTF-16");
  if (has("\xEF\xBB\xBF")) what.emplace_back("a mark of UTF-8");
  if (!wide && has({"\0", 1})) what.emplace_back("NUL bytes");
  if (has("\x1B[")) what.emplace_back("ANSI sequences");
  if (!what.empty()) grammar.says.push_back("taken away: " + joined(what, ", "));
}

/// Fills what is known of each slot, by the frames of these lines; false where they explain less than two
/// fifths of the lines.
bool fill_slots(const std::vector<std::string>& lines, TextGrammar& grammar) {
  FrameFormat read = grammar.format;
  read.checksum = "none";  // has been taken away
  const auto each_frame = [&](const auto& take) {
    TextFrames frames(read);
    for (const std::string& line : lines)
      if (frames.push(line) == TextFrames::Result::frame) take(frames.slots());
  };
  const auto words_of = [](const std::vector<TextSlot>& slots) {
    std::vector<bool> words;
    for (const TextSlot& slot : slots) words.push_back(slot.words);
    return words;
  };
  std::map<std::size_t, std::vector<std::string>> names;  // lines that name what follows, by their cells
  std::map<std::vector<bool>, std::size_t> forms;         // which cells are words
  each_frame([&](const std::vector<TextSlot>& slots) {
    if (const auto words = words_of(slots); std::ranges::count(words, false) > 0) {
      ++forms[words];
      return;
    }
    std::vector<std::string>& cells = names[slots.size()];
    cells.clear();
    for (const TextSlot& slot : slots) cells.emplace_back(slot.text);
  });
  if (forms.empty()) return false;
  const auto form = std::ranges::max_element(forms, {}, [](const auto& f) {
    return f.second * static_cast<std::size_t>(std::ranges::count(f.first, false));
  });
  const std::vector<bool>& usual = form->first;
  const std::size_t count = form->second;
  if (static_cast<double>(count) * grammar.format.lines_per_frame <
      0.4 * static_cast<double>(lines.size() - std::ranges::count(lines, "")))
    return false;
  std::map<std::vector<std::string>, std::size_t> units;
  std::size_t number = 0;
  grammar.slots.resize(usual.size());
  each_frame([&](const std::vector<TextSlot>& slots) {
    if (words_of(slots) != usual) return;
    const bool is_sample = number++ == count / 2;
    std::vector<std::string> unit;
    for (std::size_t c = 0; c < slots.size(); ++c) {
      FoundSlot& found = grammar.slots[c];
      const TextSlot& slot = slots[c];
      found.column.push_back(slot.value), unit.emplace_back(slot.unit);
      if (is_sample)
        found.before = slot.before, found.sample = slot.text, found.line = slot.line,
        found.words = slot.words, found.wall = slot.wall;
      const std::size_t point = slot.text.find_first_of(grammar.format.decimal == ',' ? ",." : ".");
      if (point != std::string::npos)
        found.decimals = std::max(found.decimals, static_cast<int>(slot.text.size() - point - 1));
    }
    ++units[unit];
  });
  if (const auto named = names.find(usual.size()); named != names.end())
    for (std::size_t c = 0; c < usual.size(); ++c) grammar.slots[c].name = named->second[c];
  if (20 * std::ranges::max_element(units, {}, [](const auto& u) { return u.second; })->second < 19 * count)
    grammar.doubt = "the same number has another unit, or brackets, at times: what they mean is not known";
  return true;
}

}  // namespace

std::optional<TextGrammar> find_grammar(const std::vector<std::string>& raw) {
  std::vector<std::string> lines;
  bool all_remarks = true;
  for (const std::string& line : raw) {
    lines.push_back(clean_line(line));
    all_remarks = all_remarks && (lines.back().empty() || lines.back().starts_with('#'));
  }
  if (!all_remarks) std::erase_if(lines, [](const auto& line) { return line.starts_with('#'); });
  TextGrammar grammar;
  grammar.format = {.kind = FrameKind::text};
  grammar.format.checksum = find_checksum(lines);
  if (grammar.format.checksum != "none")
    for (std::string& line : lines)
      if (const auto sum = checksum_of(line)) line = std::string(trimmed(sum->line));
  bool unsure = false;
  if (const std::string hex = bare_hexadecimal(lines, unsure); !hex.empty()) {
    grammar.doubt =
        "hexadecimal numbers without 0x, which no sensor's file can say, or decimal ones, as in " +
        in_quotes(hex.substr(0, 40));
    return grammar;
  }
  if (unsure)
    grammar.says.emplace_back(
        "read as decimal: all numbers have as many digits, so they may be hexadecimal ones without 0x");
  const Commas commas = commas_of(lines, ',');
  const char decimal = commas == Commas::points ? ',' : '.';
  // Cells where no number is lost in them, else numbers.
  Reading reading = read_as(lines, 0, decimal);
  for (const char separator : {',', ';', '\t', '|', ' '}) {
    if (separator == decimal) continue;
    const Reading cells = read_as(lines, separator, decimal);
    if (cells.slots < 2 || cells.numbers < reading.numbers || cells.share < reading.share - 0.1) continue;
    reading = cells;
    break;
  }
  if (reading.numbers == 0 || reading.share < 0.5) return std::nullopt;
  grammar.format.separator = reading.separator, grammar.format.decimal = decimal;
  if (const Survey survey = survey_of(lines, decimal); !survey.own && !find_turns(survey, grammar))
    find_index(survey, grammar);
  if (commas == Commas::doubt)
    grammar.doubt = "a comma between digits, as in " + in_quotes(lines[lines.size() / 2].substr(0, 40)) +
                    ", may be the point of one number or stand between two (\"decimal\" says which)";
  if (commas == Commas::thousands || commas_of(lines, '.') == Commas::thousands || blank_thousands(lines))
    grammar.doubt = "marks before three digits, as in " + in_quotes(lines[lines.size() / 2].substr(0, 40)) +
                    ", part thousands, or are points or parts of a list: let the sensor send plain numbers";
  if (grammar.format.lines_per_frame > 1) grammar.format.separator = 0;
  say_what_was_taken_away(raw, grammar);
  return fill_slots(lines, grammar) ? std::optional(std::move(grammar)) : std::nullopt;
}

}  // namespace supertac
