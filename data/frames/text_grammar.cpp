#include "data/frames/text_grammar.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>

#include "data/frames/binary_decoder.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

bool digit(char c) { return c >= '0' && c <= '9'; }
bool letter(char c) { return (lower(c) >= 'a' && lower(c) <= 'z') || c == '_'; }
bool word(char c) { return digit(c) || letter(c); }

char at(std::string_view text, std::size_t i) { return i < text.size() ? text[i] : '\0'; }

/// Digits from i on, `least` to `most` of them: their number, and i behind them.
std::optional<int> digits(std::string_view text, std::size_t& i, std::size_t least, std::size_t most) {
  std::size_t end = i;
  while (end - i < most && digit(at(text, end))) ++end;
  if (end - i < least || digit(at(text, end))) return std::nullopt;
  int value = 0;
  std::from_chars(text.data() + i, text.data() + end, value);
  i = end;
  return value;
}

/// Date, time or both from i on; i behind them.
std::optional<double> wall_time(std::string_view text, std::size_t& i) {
  std::size_t k = i;
  double seconds = 0;
  bool dated = false;
  if (const auto year = digits(text, k, 4, 4); year && (at(text, k) == '-' || at(text, k) == '/')) {
    const char between = text[k++];
    const auto month = digits(text, k, 1, 2);
    if (!month || at(text, k++) != between) return std::nullopt;
    const auto day = digits(text, k, 1, 2);
    const std::chrono::year_month_day date{std::chrono::year{*year},
                                           std::chrono::month{static_cast<unsigned>(*month)},
                                           std::chrono::day{static_cast<unsigned>(day.value_or(0))}};
    if (!date.ok()) return std::nullopt;
    seconds = 86400.0 * std::chrono::sys_days{date}.time_since_epoch().count(), dated = true;
    i = k;
    if (at(text, k) != 'T' && at(text, k) != ' ') return seconds;
    ++k;
  } else {
    k = i;
  }
  const auto failed = [&] { return dated ? std::optional(seconds) : std::nullopt; };
  std::array<int, 3> hms{};
  for (std::size_t part = 0; part < 3; ++part) {
    if (part > 0 && at(text, k++) != ':') return failed();
    const auto number = digits(text, k, part == 0 ? 1 : 2, 2);
    if (!number || *number > (part == 0 ? 23 : 60)) return failed();
    hms[part] = *number;
  }
  seconds += 3600.0 * hms[0] + 60.0 * hms[1] + hms[2];
  if ((at(text, k) == '.' || at(text, k) == ',' || at(text, k) == ':') && digit(at(text, k + 1))) {
    std::size_t end = k + 1;
    while (digit(at(text, end))) ++end;
    // "12:00:00,512,498" is a time of whole seconds and two values, unless three or six digits are a fraction
    // of a logger; then the next thing is a blank.
    if (text[k] == '.' || ((end - k == 4 || end - k == 7) && at(text, end) == ' '))
      seconds += parse_double("0." + std::string(text.substr(k + 1, end - k - 1))).value_or(0), k = end;
  }
  if (at(text, k) == 'Z') ++k;
  if (dated && (at(text, k) == '+' || at(text, k) == '-') && digit(at(text, k + 1)) && digit(at(text, k + 2)))
    for (++k; digit(at(text, k)) || at(text, k) == ':';) ++k;
  if (word(at(text, k))) return failed();
  i = k;
  return seconds;
}

bool no_value(std::string_view text) {
  constexpr std::array kNone{"nan", "-nan", "+nan", "null", "none", "n/a",  "na",
                             "-",   "--",   "---",  "inf",  "-inf", "+inf", "ovf"};
  return std::ranges::any_of(
      kNone, [&](std::string_view none) { return std::ranges::equal(none, text, {}, {}, lower); });
}

/// Whether a mark at i, behind a digit, parts thousands: three digits follow, and no fourth.
bool thousands(std::string_view text, std::size_t i) {
  return i > 0 && digit(text[i - 1]) && digit(at(text, i + 1)) && digit(at(text, i + 2)) &&
         digit(at(text, i + 3)) && !digit(at(text, i + 4));
}

/// The number from i on; i behind it.
std::optional<double> number_at(std::string_view text, std::size_t& i, char decimal) {
  std::size_t k = i;
  const bool sign = at(text, k) == '-' || at(text, k) == '+';
  if (sign) ++k;
  if (at(text, k) == '0' && lower(at(text, k + 1)) == 'x') {
    std::uint64_t value = 0;
    const auto read = std::from_chars(text.data() + k + 2, text.data() + text.size(), value, 16);
    const auto end = static_cast<std::size_t>(read.ptr - text.data());
    if (read.ec != std::errc{} || word(at(text, end))) return std::nullopt;
    const double number = static_cast<double>(value);
    const bool minus = text[i] == '-';
    i = end;
    return minus ? -number : number;
  }
  const std::size_t begin = k;
  const auto take = [&] {
    while (digit(at(text, k)) || (at(text, k) == '\'' && thousands(text, k))) ++k;
  };
  take();
  // Where commas are points, points are too: a clock may be written with one, and the signals not.
  const char point = at(text, k);
  if ((point == '.' || point == decimal) && (digit(at(text, k + 1)) || (point == '.' && k > begin))) {
    ++k;
    take();
  }
  if (k == begin) return std::nullopt;
  if (const char mark = lower(at(text, k)); mark == 'e' || mark == 'd') {
    const std::size_t power = k + 1 + (at(text, k + 1) == '-' || at(text, k + 1) == '+' ? 1 : 0);
    if (digit(at(text, power)) && (mark == 'e' || power > k + 1)) {
      k = power;
      take();
    }
  }
  const std::size_t from = text[i] == '-' ? i : begin;
  std::string plain(text.substr(from, k - from));
  for (char& c : plain) c = c == decimal ? '.' : lower(c) == 'd' ? 'e' : c;
  std::erase(plain, '\'');
  const char next = at(text, k);
  if ((next == '.' || (next == ',' && decimal == ',' && point == '.')) && digit(at(text, k + 1)))
    return std::nullopt;  // 1.2.3, and 1.234,5
  for (std::size_t unit = k; word(at(text, unit)); ++unit)
    if (digit(text[unit])) return std::nullopt;  // 3A7F
  const auto value = parse_double(plain);
  if (value) i = k;
  return value;
}

/// A cell as a number, with nothing around it.
TextSlot cell_of(std::string_view cell, char decimal) {
  TextSlot slot{.value = std::nan(""), .text = cell, .before = {}, .unit = {}};
  std::size_t end = 0, wall_end = 0;
  if (const auto number = number_at(cell, end, decimal); number && end == cell.size())
    slot.value = *number;
  else if (const auto seconds = wall_time(cell, wall_end); seconds && wall_end == cell.size())
    slot.value = *seconds, slot.wall = true;
  else
    slot.words = !cell.empty() && !no_value(cell);
  return slot;
}

bool lists(char c) { return c == ',' || c == ';' || c == '|'; }

/// A mark that stands for no value, such as "nan", or nothing between two commas, from i on; i behind it.
bool none_at(std::string_view line, std::size_t& i) {
  if (lists(at(line, i))) {
    const std::size_t next = line.find_first_not_of(' ', i + 1);
    if (next == std::string_view::npos || line[next] != line[i]) return false;
    i = next;  // the second one begins what follows
    return true;
  }
  std::size_t end = i;
  while (word(at(line, end)) || at(line, end) == '-' || at(line, end) == '/' || at(line, end) == '+') ++end;
  const std::string_view mark = line.substr(i, end - i);
  if (mark.empty() || !no_value(mark)) return false;
  if (i == 0 && mark.size() < 3) return false;
  if (mark.find_first_not_of('-') == std::string_view::npos) {
    // "12:00 - 5": a dash is no value only within a list.
    const std::size_t before = i == 0 ? std::string_view::npos : line.find_last_not_of(' ', i - 1);
    const std::size_t after = line.find_first_not_of(' ', end);
    const bool left = before == std::string_view::npos || lists(line[before]) || line[before] == '\t';
    const bool right = after == std::string_view::npos || lists(line[after]) || line[after] == '\t';
    if (!left || !right || (before == std::string_view::npos && after == std::string_view::npos))
      return false;
  }
  i = end;
  return true;
}

}  // namespace

std::string clean_line(std::string_view line) {
  const auto stays = [](char c) { return (c >= ' ' && c <= '~') || c == '\t' || c == '\r'; };
  if (std::ranges::all_of(line, stays)) return std::string(trimmed(line));
  std::string clean;
  clean.reserve(line.size());
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\0') continue;
    if (line.substr(i, 3) == "\xEF\xBB\xBF") {
      i += 2;
    } else if (line.substr(i, 3) == "\xE2\x88\x92") {
      clean += '-', i += 2;  // the minus of Unicode
    } else if (line[i] == '\xFF' || line[i] == '\xFE') {
      continue;  // of UTF-16
    } else if (line[i] == '\x1B' && at(line, i + 1) == '[') {
      for (i += 2; i < line.size() && (line[i] < '@' || line[i] > '~');) ++i;
    } else {
      clean += line[i];
    }
  }
  return std::string(trimmed(clean));
}

std::vector<TextSlot> slots_of(std::string_view line, char separator, char decimal) {
  std::vector<TextSlot> slots;
  if (separator != 0) {
    const auto cells = split_line(line, separator);
    slots.reserve(cells.size());
    for (std::string_view cell : cells) {
      if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
        cell = trimmed(cell.substr(1, cell.size() - 2));
      slots.push_back(cell_of(cell, decimal));
    }
    return slots;
  }
  std::size_t behind = 0;
  for (std::size_t i = 0; i < line.size();) {
    const std::size_t begin = i;
    const bool boundary = i == 0 || (!word(line[i - 1]) && line[i - 1] != '.');
    TextSlot slot;
    bool found = false;
    if (boundary && digit(line[i])) {
      if (const auto seconds = wall_time(line, i)) slot.value = *seconds, found = slot.wall = true;
    }
    if (!found && boundary && (digit(line[i]) || line[i] == '.' || line[i] == '-' || line[i] == '+')) {
      if (const auto number = number_at(line, i, decimal)) slot.value = *number, found = true;
    }
    if (!found && boundary && (!slots.empty() || lower(line[i]) == 'n') && none_at(line, i))
      slot.value = std::nan(""), found = true;
    if (!found) {
      if (word(line[i]) || line[i] == '.')
        while (i < line.size() && (word(line[i]) || line[i] == '.')) ++i;
      else
        ++i;
      continue;
    }
    const std::size_t text = lists(line[begin]) ? begin + 1 : begin;
    slot.text = line.substr(text, i - text), slot.before = line.substr(behind, text - behind);
    const std::size_t end = i;
    while (i < line.size() && (letter(line[i]) || static_cast<unsigned char>(line[i]) > 127)) ++i;
    slot.unit =
        slot.before.ends_with('(') && at(line, i) == ')' ? line.substr(i, 1) : line.substr(end, i - end);
    slots.push_back(slot);
    behind = i;
  }
  return slots;
}

std::string_view behind_stamp(std::string_view line) {
  std::size_t i = 0;
  const bool bracket = line.starts_with('[');
  if (bracket) line.remove_prefix(1);
  if (!wall_time(line, i)) return bracket ? std::string_view(line.data() - 1, line.size() + 1) : line;
  if (bracket && at(line, i) == ']') ++i;
  line = trimmed(line.substr(i));
  if (line.starts_with("->")) line = trimmed(line.substr(2));
  return line;
}

std::optional<TextChecksum> checksum_of(std::string_view line) {
  std::size_t begin = line.size();
  while (begin > 0 && word(line[begin - 1])) --begin;
  const std::string_view hex = line.substr(begin);
  TextChecksum sum{.line = {}, .stated = 0, .digits = static_cast<unsigned>(hex.size())};
  if (begin < 2 || (hex.size() != 2 && hex.size() != 4 && hex.size() != 8)) return std::nullopt;
  const auto read = std::from_chars(hex.data(), hex.data() + hex.size(), sum.stated, 16);
  const char mark = line[begin - 1];
  if (read.ptr != hex.data() + hex.size() ||
      std::string_view("*,; \t|#:").find(mark) == std::string_view::npos)
    return std::nullopt;
  sum.line = line.substr(0, begin - 1);
  return sum;
}

unsigned TextChecksum::computed(const std::string& kind) const {
  return checksum_of(kind, std::as_bytes(std::span(line.substr(line.starts_with('$') ? 1 : 0))));
}

TextFrames::Result TextFrames::push(std::string_view line) {
  const std::string_view content = format_.lines_per_frame > 1 ? behind_stamp(line) : line;
  const bool many = format_.lines_per_frame > 1, partial = open_ && !lines_.empty();
  const Result before = partial ? Result::torn : Result::nothing;
  if (content.empty()) {
    if (many && format_.prefix.empty()) lines_.clear(), open_ = true;
    return many && format_.prefix.empty() ? before : Result::nothing;
  }
  const bool begins = !format_.prefix.empty() &&
                      (content.starts_with(format_.prefix) || behind_stamp(line).starts_with(format_.prefix));
  if (!many || begins) lines_.clear(), open_ = begins || format_.prefix.empty();
  if (!open_) return Result::torn;
  if (format_.checksum != "none") {
    const auto sum = checksum_of(line);
    if (!sum || (format_.checksum != "hex" && sum->computed(format_.checksum) != sum->stated))
      return open_ = false, Result::torn;
    line = trimmed(sum->line);
  }
  lines_.emplace_back(many ? behind_stamp(line) : line);
  if (static_cast<int>(lines_.size()) < format_.lines_per_frame) return begins ? before : Result::nothing;
  slots_.clear();
  for (std::size_t of = 0; of < lines_.size(); ++of)
    for (TextSlot& slot : slots_of(lines_[of], format_.separator, format_.decimal))
      slot.line = of, slots_.push_back(slot);
  open_ = false;
  return Result::frame;
}

}  // namespace supertac
