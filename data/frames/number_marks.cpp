// What the marks within numbers are: points, thousands, letters of hexadecimal ones.
#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>

#include "data/frames/text_grammar.h"
#include "io/numbers/text.h"

namespace supertac {

Commas commas_of(const std::vector<std::string>& lines, char mark) {
  struct Digits {
    std::size_t count = 0, leading = 0, trailing = 0, bare = 0;
    std::map<std::size_t, std::size_t> widths = {};
    std::map<char, std::size_t> firsts = {};
  };
  std::map<std::pair<std::size_t, std::size_t>, Digits> places;  // by the line's count of slots, and which
  std::size_t all = 0, parted = 0, fractions = 0, with = 0, padded = 0;
  for (const std::string& line : lines) {
    const auto slots = slots_of(behind_stamp(line), 0, mark);
    with += !slots.empty();
    for (std::size_t i = 0; i < slots.size(); ++i) {
      if (slots[i].wall) continue;
      ++all;
      std::string before(slots[i].before);
      std::erase(before, '"');
      parted += i > 0 && before == ",";
      Digits& place = places[{slots.size(), i}];
      const std::size_t comma = slots[i].text.find(mark);
      place.bare += comma == std::string::npos && slots[i].text.find('.') == std::string::npos;
      if (comma == std::string::npos) continue;
      const std::string_view whole = slots[i].text.substr(0, comma), part = slots[i].text.substr(comma + 1);
      ++fractions, padded += whole.size() > 1 && whole[0] == '0';
      if (part.empty()) continue;
      ++place.count, ++place.widths[part.size()], ++place.firsts[part[0]];
      place.leading += part.size() > 1 && part[0] == '0', place.trailing += part.back() == '0';
    }
  }
  if (fractions == 0 || (mark == ',' && 20 * parted >= all)) return Commas::lists;
  std::map<std::size_t, Digits> groups;  // of places by their width, 0 where they have several
  for (auto& [place, of] : places) {
    std::erase_if(of.widths,
                  [&](const auto& w) { return 25 * w.second < of.count; });  // damaged lines are few
    if (of.widths.empty()) continue;
    const bool one = of.widths.size() == 1;
    if (one && of.widths.begin()->first == 3 && 25 * std::min(of.bare, of.count) > of.bare + of.count)
      return Commas::thousands;
    Digits& group = groups[one ? of.widths.begin()->first : 0];
    group.count += of.count, group.leading += of.leading, group.trailing += of.trailing;
    for (const auto& [digit, count] : of.firsts) group.firsts[digit] += count;
  }
  if (mark == '.' || 25 * padded >= fractions) return mark == '.' ? Commas::points : Commas::doubt;
  bool points = false, lists = false;
  for (auto& [width, of] : groups) {
    if (of.count < 40) continue;  // of so many numbers one ends in 0, and one digit in ten is each
    std::erase_if(of.firsts, [&](const auto& f) { return 100 * f.second < of.count; });
    const bool zeros = 25 * of.leading >= of.count;
    if (width == 0) (25 * of.trailing < of.count ? points : lists) = true;
    points = points || (width == 1 && of.firsts.size() == 10) || (width > 1 && zeros);
    lists = lists || (width > 1 && width != 3 && !zeros && of.firsts.size() == 9);
  }
  if (points == lists) return Commas::doubt;
  // A line that is nothing else is rather two columns than one.
  if (all == fractions && all <= with) return points ? Commas::doubt : Commas::lists;
  return points ? Commas::points : Commas::lists;
}

bool blank_thousands(const std::vector<std::string>& lines) {
  std::size_t cells = 0, parted = 0;
  for (const std::string& line : lines)
    for (const char separator : {';', '\t', '|', ','})
      for (const std::string_view cell : split_line(line, separator)) {
        if (cell.size() == line.size() || cell.empty()) continue;
        bool grouped = true, blanks = false;
        for (std::size_t i = 0; grouped && i < cell.size(); ++i) {
          if (cell[i] != ' ') continue;
          const std::string_view digits = cell.substr(i + 1, 4);
          grouped = i > 0 && digits.size() >= 3 && digits.find_first_not_of("0123456789") >= 3 &&
                    (digits.size() < 4 || digits.find_first_not_of("0123456789") == 3);
          blanks = true;
        }
        ++cells,
            parted += grouped && blanks && cell.find_first_not_of("0123456789 ,.-") == std::string_view::npos;
      }
  return 10 * parted > cells;
}

std::string bare_hexadecimal(const std::vector<std::string>& lines, bool& unsure) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  struct Place {
    std::size_t digits = 0, letters = 0;
    std::string sample = {};
  };
  std::map<std::array<std::size_t, 3>, Place> places;  // by the line's count of words, which, and its length
  std::map<std::size_t, std::size_t> widths;
  std::set<char> lasts;
  for (const std::string& line : lines) {
    std::vector<std::string_view> words;
    for (std::size_t i = 0, end = 0; i < line.size(); i = end + 1) {
      for (end = i; std::isalnum(static_cast<unsigned char>(line.c_str()[end])) != 0;) ++end;
      if (end > i) words.push_back(std::string_view(line).substr(i, end - i));
    }
    for (std::size_t k = 0; k < words.size(); ++k) {
      const auto hex = [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; };
      Place& place = places[{words.size(), k, words[k].size()}];
      ++widths[words[k].size()], lasts.insert(words[k].back());
      if (words[k].size() < 2 || !std::ranges::all_of(words[k], hex)) continue;
      const bool letters = !std::ranges::all_of(words[k], digit);
      ++(letters ? place.letters : place.digits);
      if (letters) place.sample = line;
    }
  }
  for (const auto& [key, place] : places)
    if (std::min(place.digits, place.letters) >= 2 + lines.size() / 50) return place.sample;
  unsure = widths.size() == 1 && widths.begin()->first > 1 && lasts.size() < 10 &&
           std::ranges::all_of(lasts, digit);
  return "";
}

}  // namespace supertac
