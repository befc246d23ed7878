// What each slot of a frame is, by models.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>

#include "data/frames/probe.h"
#include "data/frames/text_grammar.h"
#include "io/numbers/median.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kFew = 12;  // frames: of less nothing can be said

bool whole(const std::vector<double>& v) {
  return std::ranges::all_of(v, [](double x) { return x == std::round(x); });
}
bool constant(const std::vector<double>& v) {
  return std::ranges::all_of(v, [&](double x) { return x == v[0] || (std::isnan(x) && std::isnan(v[0])); });
}

bool counts(const std::vector<double>& v) {
  if (v.size() < kFew || !whole(v) || constant(v)) return false;
  const double high = std::ranges::max(v), low = std::ranges::min(v);
  for (const double modulus : {0.0, 10.0, 16.0, 32.0, 64.0, 100.0, 128.0, 256.0, 1000.0, 1024.0, 4096.0,
                               10000.0, 65536.0, 4294967296.0}) {
    if (modulus > 0 && (high >= modulus || low < 0 || high - low < 0.5 * modulus)) continue;
    std::size_t one = 0, few = 0, wraps = 0, short_of = 0;
    for (std::size_t i = 1; i < v.size(); ++i) {
      const bool fell = modulus > 0 && v[i] < v[i - 1];
      const double step = v[i] - v[i - 1] + (fell ? modulus : 0);
      one += step == 1, few += step >= 1 && step <= 20, wraps += fell, short_of += fell && step != 1;
    }
    if (2 * short_of > wraps) continue;  // it begins anew before
    const auto all = static_cast<double>(v.size() - 1);
    if (static_cast<double>(few) >= 0.9 * all && 2 * static_cast<double>(one) > all) return true;
  }
  return false;
}

/// Of finite numbers that rise at a steady rate the usual step; 0 where they do not.
double steady_step(const std::vector<double>& v) {
  if (v.size() < kFew || constant(v)) return 0;
  for (const double modulus : {0.0, 65536.0, 4294967296.0}) {
    if (modulus > 0 && std::ranges::max(v) >= modulus) continue;
    std::vector<double> all;  // steps
    for (std::size_t i = 1; i < v.size(); ++i)
      all.push_back(v[i] - v[i - 1] + (modulus > 0 && v[i] < v[i - 1] ? modulus : 0));
    const auto fell = static_cast<double>(std::ranges::count_if(all, [](double s) { return s < 0; }));
    const double usual = quantile(all, 0.5), early = quantile(all, 0.1), late = quantile(all, 0.9);
    const double mean = (v.back() - v.front()) / static_cast<double>(all.size());
    if (fell > std::max(1.0, 0.02 * static_cast<double>(all.size()))) continue;
    if (usual > 0 && early > 0.2 * usual && late < 4 * usual) return usual;
    // Coarser than the frames: never more than two of its ticks from a straight line.
    const double tick = std::ranges::max(all);
    bool straight = modulus == 0 && fell == 0 && mean > 0;
    for (std::size_t i = 0; straight && i < v.size(); ++i)
      straight = std::abs(v[i] - v[0] - mean * static_cast<double>(i)) <= 2 * tick;
    if (straight && late <= 20 * mean) return mean;
  }
  return 0;
}

/// Whether whole numbers from 0 or 1 on run through the same again and again, as noise does not.
bool cycles(const std::vector<double>& v) {
  if (v.size() < kFew || !whole(v) || constant(v)) return false;
  if (const double low = std::ranges::min(v); low != 0 && low != 1) return false;
  for (std::size_t period = 2; 3 * period <= v.size(); ++period)
    if (std::equal(v.begin() + static_cast<std::ptrdiff_t>(period), v.end(), v.begin())) return true;
  return false;
}

/// The unit in which so much is `seconds`, to a quarter, or to `least` of them; 0: in none.
double unit_live(double went, double seconds, double least = 0.75) {
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9})
    if (const double ratio = went * unit / seconds; ratio > least && ratio < 1.25) return unit;
  return 0;
}

/// The unit in which steps are those of a sensor; 0 where two are as likely.
double unit_of_step(double step, bool whole) {
  if (!whole && step < 1) return 1;
  if (step < 0.9) return 1;
  if (step <= 200) return 1e-3;
  if (step < 1000) return 0;
  return step < 1e6 ? 1e-6 : 1e-9;
}

bool label_behind(const TextGrammar& grammar, std::size_t slot) {
  if (slot + 1 >= grammar.slots.size() || grammar.format.separator != 0) return false;
  const std::string_view behind = trimmed(grammar.slots[slot + 1].before);
  return behind.starts_with(':') || behind.starts_with('=') || behind.starts_with("]:") ||
         behind.starts_with("->");
}

/// The letters of the last word before a slot, without the digits that count it.
std::string stem(const std::string& before) {
  std::string letters;
  bool ended = false;  // the word, by a blank or a mark
  for (const char c : before) {
    const bool letter = (lower(c) >= 'a' && lower(c) <= 'z') || static_cast<unsigned char>(c) > 127;
    if (letter && ended) letters.clear();
    if (letter) letters += c;
    ended = !letter && c != '_' && (c < '0' || c > '9');
  }
  return letters;
}

/// How good an array so many values make: squares and powers of two are built, long primes are not.
int neat(std::size_t n) {
  if (n == 0) return 0;
  const auto root = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(n))));
  if (root * root == n && n >= 9) return 3;
  if (n >= 8 && (n & (n - 1)) == 0) return 3;
  for (std::size_t rows = 2; rows * rows <= n; ++rows)
    if (n % rows == 0) return n % 16 == 0 && n > 16 ? 3 : 2;
  return n <= 8 ? 2 : 1;
}

/// Sums and xors of the whole numbers before (and without) the last slot, from one of the first four numbers
/// on that are no words and no time of day.
std::string sum_of_values(const TextGrammar& grammar, std::size_t slot) {
  const std::vector<double>& stated = grammar.slots[slot].column;
  if (stated.size() < kFew || !whole(stated) || constant(stated)) return {};
  std::vector<std::size_t> numbers;
  for (std::size_t c = 0; c < slot; ++c)
    if (!grammar.slots[c].words && !grammar.slots[c].wall) numbers.push_back(c);
  for (std::size_t first = 0; first < std::min<std::size_t>(numbers.size(), 4); ++first)
    for (const double modulus : {0.0, 256.0, 65536.0, 100.0, 1000.0, -1.0}) {
      std::size_t fits = 0;
      for (std::size_t i = 0; i < stated.size(); ++i) {
        double sum = 0;
        std::int64_t crossed = 0;
        for (const std::size_t c : std::span(numbers).subspan(first)) {
          const double number = grammar.slots[c].column[i];
          if (!std::isfinite(number)) continue;
          sum += number;
          if (std::abs(number) < 1e15) crossed ^= static_cast<std::int64_t>(number);
        }
        const double made = modulus < 0   ? static_cast<double>(crossed)
                            : modulus > 0 ? sum - modulus * std::floor(sum / modulus)
                                          : sum;
        fits += made == stated[i];
      }
      if (static_cast<double>(fits) >= 0.9 * static_cast<double>(stated.size()))
        return (modulus < 0 ? "xor" : "sum") + std::string(modulus > 0 ? " modulo " + format(modulus) : "") +
               " of slots " + std::to_string(numbers[first]) + " to " + std::to_string(slot - 1) +
               ", computed again";
    }
  return {};
}

/// Of slot `c`, by its own numbers; `clock`: there is one already.
SlotRole role_of(TextGrammar& g, std::size_t c, double seconds, bool clock) {
  const FoundSlot& slot = g.slots[c];
  const std::vector<double>& v = slot.column;
  if (slot.words) return {SlotRole::words, "no number, such as " + in_quotes(slot.sample)};
  if (c >= 2 && c + 2 >= g.slots.size())
    if (const std::string sum = sum_of_values(g, c); !sum.empty()) return {SlotRole::checksum, sum};
  if (slot.wall) return {SlotRole::clock, "a time of day or date", 1};
  const bool finite = std::ranges::all_of(v, [](double x) { return std::isfinite(x); });
  const bool live = seconds >= kAtOnceS;
  if (const auto unit = live && finite && !clock ? unit_of_clock(v, seconds) : std::nullopt)
    return {SlotRole::clock, "rises as fast as time goes", *unit};
  if (counts(v)) return {SlotRole::counter, "rises by one"};
  if (const double step = finite ? steady_step(v) : 0; step > 0) {
    // Of one that runs over, or beside another clock, arrival says the unit; in a file its step does.
    const double unit =
        live ? unit_live(step * static_cast<double>(v.size() - 1), seconds) : unit_of_step(step, whole(v));
    if (unit == 0 && !clock)
      g.doubt = "slot " + std::to_string(c) + " rises by about " + format(step, 3) +
                " a frame, which is time in no unit (s, ms, us, ns): a clock, or a signal that only rose";
    return {SlotRole::clock, "rises at a steady rate, " + format(step, 3) + " a frame", unit};
  }
  if (constant(v) && label_behind(g, c))
    return {SlotRole::label, "never changes, and ':' or '=' stands behind it"};
  if (constant(v))
    return {SlotRole::constant,
            std::isnan(v[0]) ? "says " + in_quotes(slot.sample) + " only" : "is always " + format(v[0])};
  if (cycles(v))
    g.doubt = "slot " + std::to_string(c) +
              " runs through the same numbers again and again: a row or column that its line belongs to, or "
              "a signal";
  if (!finite || v.size() < kFew || !std::ranges::is_sorted(v))
    return {SlotRole::signal, "changes from frame to frame"};
  g.doubt = "slot " + std::to_string(c) +
            " only rises, and not steadily: a clock, or a signal that rose meanwhile; listen for longer";
  return {SlotRole::other, "only rises"};
}

bool candidate(const FoundSlot& slot) {
  return slot.role.kind == SlotRole::signal || slot.role.kind == SlotRole::constant;
}
std::vector<std::size_t> candidates(const TextGrammar& g) {
  std::vector<std::size_t> all;
  for (std::size_t c = 0; c < g.slots.size(); ++c)
    if (candidate(g.slots[c])) all.push_back(c);
  return all;
}

/// Numbers that count the rows or the taxels: in turn with others a constant, one more each time.
void find_counts(TextGrammar& g) {
  const std::vector<std::size_t> all = candidates(g);
  const auto column = [&](std::size_t i) -> const std::vector<double>& { return g.slots[all[i]].column; };
  const std::size_t lines = g.format.lines_per_frame == 2 ? 2 : 3;  // at least
  for (std::size_t width = 2; lines * width <= all.size(); ++width)
    for (std::size_t place = 0; all.size() % width == 0 && place < width; ++place) {
      bool counted = true;
      for (std::size_t i = place; counted && i < all.size(); i += width)
        counted = constant(column(i)) && (i == place || column(i)[0] == column(i - width)[0] + 1);
      for (std::size_t i = place; counted && i < all.size(); i += width)
        g.slots[all[i]].role = {SlotRole::label, "counts the rows, or the taxels"};
    }
}

/// Numbers named otherwise than most are no taxels of the array. Names that take turns are a taxel's
/// channels; others of as many numbers each are other quantities, unless they are the letters of the rows.
void compare_names(TextGrammar& g) {
  std::map<std::string, std::vector<std::size_t>> named;
  std::string name;
  for (std::size_t c = 0; c < g.slots.size(); ++c) {
    const FoundSlot& slot = g.slots[c];
    if (!slot.name.empty()) {
      name = stem(slot.name);
    } else if (g.format.separator != 0) {
      if (slot.words && !stem(slot.sample).empty()) name = stem(slot.sample);
    } else if (candidate(slot)) {
      const std::string own = stem(slot.before);
      const bool first = c > 0 && !candidate(g.slots[c - 1]) && g.format.lines_per_frame == 1;
      if (!own.empty() || first) name = own;
    }
    if (candidate(slot)) named[name].push_back(c);
  }
  if (named.size() < 2) return;
  const auto count = [](const auto& entry) { return entry.second.size(); };
  const std::size_t most = count(*std::ranges::max_element(named, {}, count));
  for (const auto& [label, slots] : named)
    if (4 * slots.size() <= most || (slots.size() == 1 && most >= 4))
      for (const std::size_t c : slots)
        g.slots[c].role = {SlotRole::other, "named " + in_quotes(label) + " unlike the others"};
  std::erase_if(named, [&](const auto& e) { return !candidate(g.slots[e.second[0]]); });
  if (named.size() < 2) return;
  const std::vector<std::size_t>& begin = named.begin()->second;
  bool alike = true, turns = named.size() <= 8 && most > 1, rows = true;
  char letter = 'a';
  for (const auto& [label, slots] : named) {
    alike = alike && slots.size() == most, rows = rows && label.size() == 1 && lower(label[0]) == letter++;
    for (std::size_t i = 1; turns && i < slots.size(); ++i)
      turns = slots[i] == slots[i - 1] + slots[1] - slots[0];
    turns = turns && slots.back() > begin[0] && slots[0] < begin[0] + slots[1] - slots[0];
  }
  if (alike && turns && !rows)
    g.channels = static_cast<int>(named.size());
  else if (!alike || !rows)
    g.doubt = "numbers named " + joined(named, " and ", [](const auto& e) { return in_quotes(e.first); }) +
              ", " + joined(named, " and ", count) + " of them: one array, or several quantities";
}

/// Nor are a few that are written with other decimals.
void compare_decimals(TextGrammar& g) {
  const std::vector<std::size_t> all = candidates(g);
  std::array<std::vector<std::size_t>, 2> pointed;  // without and with decimals
  for (const std::size_t c : all)
    if (const FoundSlot& slot = g.slots[c]; !std::isnan(slot.column[0]) || !constant(slot.column))
      pointed[slot.decimals > 0].push_back(c);
  for (const bool which : {false, true}) {
    if (pointed[which].size() > 3 || pointed[!which].size() < 4 * pointed[which].size()) continue;
    for (const std::size_t c : pointed[which]) {
      if (g.slots[c].role.kind == SlotRole::constant && !which) continue;
      // At an edge: all before it, or all behind it, are of its kind.
      const auto alike = [&](std::size_t o) { return (g.slots[o].decimals > 0) == which; };
      const auto place = std::ranges::find(all, c);
      if (std::all_of(all.begin(), place, alike) || std::all_of(place, all.end(), alike))
        g.slots[c].role = {SlotRole::other,
                           which ? "has decimals, the others have none" : "has no decimals, the others have"};
      else
        g.doubt = "slot " + std::to_string(c) +
                  (which ? " has decimals, those" : " has no decimals as those") + " beside it " +
                  (which ? "have none" : "have") + ": a taxel, or another quantity";
    }
  }
}

/// A constant at an edge may be a version, a count or a dead taxel.
void look_at_edges(TextGrammar& g) {
  const std::vector<std::size_t> all = candidates(g);
  const auto moves = [&](std::size_t c) { return g.slots[c].role.kind == SlotRole::signal; };
  const auto first = std::ranges::find_if(all, moves);
  const auto last = std::find_if(all.rbegin(), std::make_reverse_iterator(first), moves).base();
  const auto lead = static_cast<std::size_t>(first - all.begin()),
             trail = static_cast<std::size_t>(all.end() - last);
  if (g.format.lines_per_frame > 1 || last - first < 4 || lead + trail == 0 || lead + trail > 4) return;
  int best = -1;
  std::vector<std::pair<std::size_t, std::size_t>> ways;  // no taxels before and behind the array
  for (std::size_t a = 0; a <= lead; ++a)
    for (std::size_t b = 0; b <= trail; ++b) {
      const std::size_t values = all.size() - a - b;
      const bool counted =
          a > 0 && g.slots[all[a - 1]].column[0] == static_cast<double>(values) && values > 4;
      const int good = counted ? 4 : neat(values);
      if (good > best) best = good, ways.clear();
      if (good == best) ways.emplace_back(a, b);
    }
  const auto [before, behind] = ways[0];
  const auto left = [&](const auto& way) { return std::to_string(all.size() - way.first - way.second); };
  if (ways.size() > 1 && best < (before + behind == 0 ? 3 : 4))
    g.doubt =
        "constants at the edge may be taxels or not: " + left(ways[0]) + " or " + left(ways[1]) + " values";
  for (std::size_t i = 0; i < before; ++i)
    g.slots[all[i]].role = {SlotRole::other, "constant before the array"};
  for (std::size_t i = all.size() - behind; i < all.size(); ++i)
    g.slots[all[i]].role = {SlotRole::other, "constant behind the array"};
}

}  // namespace

std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds) {
  if (stamps.size() < 3) return std::nullopt;
  // A clock may start anew while one listens, and stands still meanwhile; of what waited before one listened,
  // some may come first. Stamps of a clock that is coarser than the frames are the same for several.
  double went = 0, longest = 0;  // upwards
  std::size_t fell = 0, rose = 0;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    const double step = stamps[i] - stamps[i - 1];
    fell += step<0, rose += step> 0;
    went += std::max(step, 0.0), longest = std::max(longest, step);
  }
  if (fell > std::min<std::size_t>(2, stamps.size() / 20) || 2 * rose < stamps.size() - 1)
    return std::nullopt;
  if (seconds < kAtOnceS) {  // a file says nothing of the time it took
    const bool whole = std::ranges::all_of(stamps, [](double v) { return v == std::round(v); });
    if (fell > 0 || went == static_cast<double>(stamps.size() - 1)) return std::nullopt;
    const double unit = unit_of_step(went / static_cast<double>(stamps.size() - 1), whole);
    return unit > 0 ? std::optional(unit) : std::nullopt;
  }
  for (const double jump : {0.0, longest})
    if (const double unit = unit_live(went - jump, seconds, fell > 0 ? 0.3 : 0.75); unit > 0) return unit;
  return std::nullopt;
}

void find_roles(TextGrammar& g, double seconds) {
  bool clock = false;
  std::ptrdiff_t clocks = 0;
  for (std::size_t c = 0; c < g.slots.size(); ++c) {
    const SlotRole& role = g.slots[c].role = role_of(g, c, seconds, clock);
    clocks += role.kind == SlotRole::clock;
    clock = clock || (role.kind == SlotRole::clock && role.unit_s > 0);
  }
  if (clocks > 2)
    g.doubt =
        std::to_string(clocks) + " slots rise steadily: clocks, or signals that drift; listen for longer";
  find_counts(g);
  if (candidates(g).empty()) return;
  compare_names(g);
  compare_decimals(g);
  look_at_edges(g);
  const std::size_t values = candidates(g).size();
  for (std::size_t c = 0; c < g.slots.size() && values == 1; ++c)
    if (g.slots[c].role.kind == SlotRole::counter && cycles(g.slots[c].column))
      g.doubt = "slot " + std::to_string(c) +
                " runs through the same numbers again and again beside one value: the taxel that a line is "
                "of, or a counter";
  if (values > 8 && neat(values) == 1)
    for (const std::size_t less : {1U, 2U})
      if (g.doubt.empty() && neat(values - less) == 3)
        g.doubt = std::to_string(values) + " values make no array but a line: all may be taxels, or " +
                  std::to_string(values - less) + " and " + std::to_string(less) + " of another kind";
  // Lines of different counts may be different quantities.
  const auto lines = static_cast<std::size_t>(g.format.lines_per_frame);
  if (lines > 1 && g.slots.size() % lines != 0 && values < 16 && g.doubt.empty())
    g.doubt = "a frame of " + std::to_string(lines) + " lines with different counts of numbers, " +
              std::to_string(values) + " in all: they may be different quantities";
}

}  // namespace supertac
