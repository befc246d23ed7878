#include "data/frames/binary_columns.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>
#include <utility>

#include "data/frames/binary_decoder.h"
#include "io/numbers/median.h"

namespace supertac {
namespace {

double log2_gamma(double x) { return std::lgamma(x) / std::log(2.0); }

}  // namespace

double bits_of_share(double a, double b) {
  return log2_gamma(a + b + 1) + 2 * log2_gamma(0.5) - log2_gamma(a + 0.5) - log2_gamma(b + 0.5);
}

namespace {

constexpr double kMostExceptions = 0.2;  // of a constant, a counter or a clock: bytes may have been lost

// What is odd in a column comes in runs, as damage and restarts do: bits of where they begin and end, and of
// `bits` for what stands there, once for those that stay as they were a row before.
class Exceptions {
 public:
  void add(bool odd, bool as_before = false) {
    ++turns_[before_][odd];
    if (odd) ++(as_before ? same_ : new_);
    before_ = odd, ++count_;
  }
  double count() const { return same_ + new_; }
  bool too_many() const { return count() > kMostExceptions * count_; }
  double bits(double each) const {
    if (count() == 0) return 1;
    return 1 + bits_of_share(turns_[0][0], turns_[0][1]) + bits_of_share(turns_[1][0], turns_[1][1]) +
           bits_of_share(same_, new_) + new_ * each;
  }

 private:
  double turns_[2][2] = {}, same_ = 0, new_ = 0, count_ = 0;
  bool before_ = false;
};

// Code length of numbers of these classes, each as often as it is expected after those before, and within it.
// It knows no type: of what width numbers are must not tell how they move.
using Classes = std::array<std::size_t, kClasses>;
double bits_of_classes(const Classes& counts, std::size_t all) {
  const double share = 1.0 / kClasses;
  double bits = log2_gamma(static_cast<double>(all) + 1);
  for (std::size_t c = 0; c < kClasses; ++c)
    if (counts[c] > 0)
      bits += log2_gamma(share) - log2_gamma(static_cast<double>(counts[c]) + share) +
              static_cast<double>(counts[c] * c);
  return bits;
}
// That nothing ever moves is coded with the array.
double bits_of_steps(const Classes& counts, std::size_t steps) {
  return counts[0] == steps ? 0 : bits_of_classes(counts, steps);
}

// A sensor's numbers lie within 24 powers of two from 1; each beyond costs a bit.
double bits_of_size(double x) {
  if (x == 0) return 0;
  return std::isfinite(x) ? std::max(0.0, std::abs(std::log2(std::abs(x))) - 24) : 128;
}

// The number of `width` bytes, 8 at most, at `bytes`.
std::uint64_t load(const unsigned char* bytes, std::size_t width, bool big_endian) {
  return bits_at(reinterpret_cast<const std::byte*>(bytes), width, big_endian);
}

// Numbers in their order: real numbers as how many there are up to 0.
std::vector<std::int64_t> ordinals(std::span<const std::uint32_t> words, const std::string& type) {
  const std::int64_t above = std::int64_t{1} << (8 * bytes_of(type));
  const bool is_real = type == "f32", is_signed = type.front() == 'i';
  std::vector<std::int64_t> numbers(words.begin(), words.end());
  for (std::int64_t& number : numbers)
    if (number >= above / 2 && is_signed)
      number -= above;
    else if (number >= above / 2 && is_real)
      number = above / 2 - number;
  return numbers;
}

// A column read as numbers: bits of its steps in time, and of a number in its middle, for what came first may
// be no frame: alone, and for its size.
struct Column {
  double steps = 0, alone = 0, size = 0;
  std::int64_t middle = 0;
  bool still = false, high = false, highs = false;  // its highest bit is set at times, in several numbers
};
// `words`: what stands in the column, row by row.
Column column_of(std::span<const std::uint32_t> words, const std::string& type) {
  const std::size_t steps = words.size() - 1, bits_wide = 8 * bytes_of(type);
  const std::vector<std::int64_t> numbers = ordinals(words, type);
  // Far is far.
  const auto class_of = [&](std::int64_t step) {
    const int size = std::bit_width(static_cast<std::uint64_t>(std::abs(step)));
    return static_cast<std::size_t>(size) + 2 > bits_wide ? bits_wide : static_cast<std::size_t>(size);
  };
  Classes counts{}, on_level{};
  Column column{.middle = numbers[steps / 2]};
  std::int64_t before = numbers[0], levels[2] = {before, before};
  double turns[2][2] = {};
  bool high_before = false;
  for (std::size_t k = 0; k <= steps; ++k) {
    const bool high = words[k] >> (bits_wide - 1) != 0;
    const std::int64_t now = numbers[k];
    column.highs = column.highs || (high && column.high && now != levels[1]);
    column.high = column.high || high;
    if (k > 0)
      ++counts[class_of(now - before)], ++on_level[class_of(now - levels[high])], ++turns[high_before][high];
    before = levels[high] = now, high_before = high;
  }
  column.steps = bits_of_steps(counts, steps), column.still = counts[0] == steps;
  // Saturation and glitches of bytes are jumps between two levels, and back. With a sign they may look like
  // small steps across 0 as well, so both readings have both explanations.
  if (bits_wide == 8 && column.high)
    column.steps = std::min(column.steps,
                            static_cast<double>(bits_wide) + bits_of_share(turns[0][0], turns[0][1]) +
                                bits_of_share(turns[1][0], turns[1][1]) + bits_of_classes(on_level, steps));
  column.alone = std::log2(static_cast<double>(bits_wide) + 1) +
                 std::bit_width(static_cast<std::uint64_t>(std::abs(column.middle)));
  column.size = bits_of_size(static_cast<double>(column.middle));
  return column;
}

// Real numbers may all be multiples of one, such as whole numbers.
void look_at_multiples(Column& column, std::span<const std::uint32_t> words) {
  const std::size_t steps = words.size() - 1;
  const auto value = [&](std::size_t k) { return std::bit_cast<float>(words[k]); };
  const auto finite = [&](std::size_t k) { return std::isfinite(value(k)); };
  column.size = bits_of_size(double{value(steps / 2)});
  int finest = 127;
  for (std::size_t k = 0; k <= steps; ++k) {
    if (!finite(k) || value(k) == 0) continue;
    const auto mantissa = (std::bit_cast<std::uint32_t>(value(k)) & 0x7FFFFF) | 0x800000;
    finest = std::min(finest, std::max(std::ilogb(value(k)) - 23, -149) + std::countr_zero(mantissa));
  }
  Classes counts{};
  for (std::size_t k = 1; k <= steps; ++k) {
    const double n = finite(k) && finite(k - 1)
                         ? std::ldexp(std::abs(double{value(k)} - double{value(k - 1)}), -finest)
                         : std::ldexp(1.0, 32);
    ++counts[n < 1 ? 0 : std::min<std::size_t>(static_cast<std::size_t>(std::ilogb(n)) + 1, 32)];
  }
  column.steps = std::min(column.steps, bits_of_steps(counts, steps));
}

// Of a column of bytes the most frequent one, and the cost of the others: kNever where they are too many.
std::pair<unsigned char, double> usual_of(std::span<const unsigned char> column) {
  std::array<std::size_t, 256> counts{};
  for (const unsigned char byte : column) ++counts[byte];
  const auto usual = static_cast<unsigned char>(std::ranges::max_element(counts) - counts.begin());
  Exceptions others;
  for (std::size_t k = 0; k < column.size(); ++k)
    others.add(column[k] != usual, k > 0 && column[k] == column[k - 1]);
  return {usual, others.too_many() ? kNever : others.bits(8)};
}

// Of a clock that sends seconds as a real number.
std::uint64_t microseconds(double seconds) {
  return seconds >= 0 && seconds < 1e10 ? static_cast<std::uint64_t>(std::llround(1e6 * seconds)) : 0;
}

}  // namespace

BinaryColumns::BinaryColumns(Bytes bytes, const ByteStretch& stretch, double seconds)
    : bytes_(bytes), stretch_(stretch), seconds_(seconds), steps_(stretch.rows - 2) {
  find_constants();
  find_values();
  find_fields();
}

void BinaryColumns::find_constants() {
  const std::size_t period = stretch_.period;
  constant_.resize(period), usual_.resize(period);
  std::vector<unsigned char> column(steps_ + 1);
  for (std::size_t c = 0; c < period; ++c) {
    for (std::size_t k = 0; k <= steps_; ++k) column[k] = *at(k, c);
    std::tie(usual_[c], constant_[c]) = usual_of(column);
  }
  sums_ = crossed_ = {0};
  for (const unsigned char byte : bytes_.subspan(stretch_.begin, stretch_.rows * period))
    sums_.push_back(sums_.back() + byte), crossed_.push_back(crossed_.back() ^ byte);
}

double BinaryColumns::foreign_sum(std::size_t at) const {
  std::array<std::vector<unsigned char>, 5> left;  // what stays the same where the byte follows
  for (std::size_t k = 0; k <= steps_; ++k) {
    const std::size_t begin = k * stretch_.period + at + 1, end = begin + stretch_.period;
    const std::uint32_t all = sums_[end] - sums_[begin], sent = bytes_[stretch_.begin + end - 1];
    for (const std::uint32_t modulus : {255, 256}) {
      left[modulus - 255].push_back(static_cast<unsigned char>(all % modulus));
      left[modulus - 253].push_back(static_cast<unsigned char>((all + 2 * modulus - 2 * sent) % modulus));
    }
    left[4].push_back(static_cast<unsigned char>(crossed_[end] ^ crossed_[begin]));
  }
  double least = kNever;
  for (const std::vector<unsigned char>& column : left) least = std::min(least, usual_of(column).second);
  return 14 + 8 + least;  // which form; which constant; exceptions
}

void BinaryColumns::find_values() {
  const std::size_t period = stretch_.period;
  const auto read = [&](const std::string& type, std::size_t width, std::size_t column, bool big) {
    std::vector<std::uint32_t> words(steps_ + 1);
    for (std::size_t k = 0; k <= steps_; ++k)
      words[k] = static_cast<std::uint32_t>(load(at(k, column), width, big));
    Column numbers = column_of(words, type);
    if (type == "f32") look_at_multiples(numbers, words);
    return numbers;
  };
  for (const char* type : {"u8", "i8", "u16", "i16", "u32", "i32", "f32"})
    for (const bool big : {false, true}) {
      const std::size_t width = bytes_of(type);
      if ((width == 1 && big) || width > period) continue;
      Values v{type, big, width};
      std::vector<Column> columns;
      for (std::size_t c = 0; c < period; ++c) columns.push_back(read(type, width, c, big));
      for (std::size_t c = 0; c < 2 * period; ++c) {
        const Column &here = columns[c % period], &before = columns[(c + period - width) % period];
        Place place = c >= width ? v.places[c - width] : Place{};
        place.alone = here.alone, place.moves += here.steps + here.size, place.still += here.still ? 1 : 0;
        ++place.apart[std::bit_width(static_cast<std::uint64_t>(std::abs(here.middle - before.middle)))];
        place.random = here.steps > static_cast<double>(8 * width * steps_);
        place.high = here.high, place.highs = here.highs || here.still;
        v.places.push_back(place);
      }
      values_.push_back(std::move(v));
    }
}

double BinaryColumns::Values::bits(std::size_t at, std::size_t count) const {
  const Place &first = places[at], &last = places[at + (count - 1) * width];
  const Place before = at >= width ? places[at - width] : Place{};
  Classes classes{};
  for (std::size_t c = 0; c < kClasses; ++c)
    classes[c] = static_cast<std::size_t>(last.apart[c] - first.apart[c]);
  const double still = last.still - before.still;
  // One in the middle is told first, and from it the others, for what stands at an edge may be no value.
  return places[at + count / 2 * width].alone + (last.moves - before.moves) +
         bits_of_classes(classes, count - 1) + bits_of_share(still, static_cast<double>(count) - still);
}

void BinaryColumns::add_counter(std::size_t column, std::size_t width, bool big_endian, bool real) {
  const auto number = [&](std::size_t k) {
    const std::uint64_t bits = load(at(k, column), width, big_endian);
    return real ? microseconds(std::bit_cast<double>(bits)) : bits;
  };
  const std::uint64_t mask = width == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << 8 * width) - 1;
  const double begin = std::bit_width(number(0));
  std::vector<double> steps;
  Exceptions not_one;
  for (std::size_t k = 1; k <= steps_; ++k) {
    steps.push_back(static_cast<double>((number(k) - number(k - 1)) & mask));
    not_one.add(steps.back() != 1);
  }
  const std::string type = (real ? "f" : "u") + std::to_string(8 * width);
  FieldFound found{.field = {FrameField::Is::counter, 0, type}, .width = width, .big_endian = big_endian};
  if (width < 8 && !not_one.too_many()) {
    found.bits = 4 + begin + not_one.bits(begin);
    fields_[column].push_back(found);
    return;
  }
  // Its lowest byte moves; and it began in a year that a computer knows.
  if (width == 1 || (!real && constant(big_endian ? column + width - 1 : column) < kNever)) return;
  // A clock goes on, evenly but for a few steps, half of them within a fifth of the usual one, and about as
  // fast as the host's. A counter before random bytes goes on less evenly.
  const double usual = median(std::vector<double>(steps));
  if (usual < 1 || usual > std::min(static_cast<double>(mask) / 4, 1e9)) return;
  Classes counts{};
  double went = 0;
  Exceptions jumps;
  std::vector<double> aways;
  for (const double step : steps) {
    const double away = aways.emplace_back(std::abs(step - usual));
    const bool jump = away > 3 * usual + 2;
    jumps.add(jump);
    if (!jump) went += step;
    ++counts[jump ? 0 : std::bit_width(static_cast<std::uint64_t>(away))];
  }
  if (went <= 0 || jumps.too_many() || median(std::move(aways)) > 1 + usual / 5) return;
  const double mean = went / static_cast<double>(steps_), where = begin + std::log2(8.0 * 8),
               pace = std::bit_width(static_cast<std::uint64_t>(usual));
  found.bits = (width == 4 ? 4 : 8) + where + pace + jumps.bits(where) + bits_of_steps(counts, steps_);
  found.time.type = type;
  double best = kNever, second = kNever;
  for (const double unit : {1e-3, 1e-6}) {
    const double rate = 1 / (mean * unit), ratio = went * unit / std::max(seconds_, 1e-9);
    if (real && unit > 1e-6) continue;
    if (rate < 0.3 || rate > 50'000 || static_cast<double>(number(0)) * unit > 1e10) continue;
    double odds = std::pow(std::log10(rate / 100), 2);  // frames come 10 to 1000 times a second
    if (seconds_ >= kAtOnceS) odds = ratio > 0.75 && ratio < 1.25 ? 0 : kNever;
    if (odds < best)
      second = best, best = odds, found.time.unit_s = unit;
    else
      second = std::min(second, odds);
  }
  if (best == kNever) {  // linear, but in no unit that is known
    found.field = {FrameField::Is::skip, width, ""}, found.bits += 20;
  } else {
    found.field = {FrameField::Is::time, 0, ""}, found.sure = second - best > 3 && best < 2;
    // Clocks count from when a sensor was switched on: with each doubling past an hour fewer have run so
    // long.
    found.bits +=
        best + 2 * std::max(0.0, std::log2(static_cast<double>(number(0)) * found.time.unit_s / 3600));
    if (real) found.time.unit_s = 1;
  }
  fields_[column].push_back(found);
}

void BinaryColumns::find_fields() {
  const std::size_t period = stretch_.period;
  fields_.resize(period);
  for (std::size_t c = 0; c < period; ++c) {
    for (const std::size_t width : {1, 2, 4, 8})
      for (const bool big : {false, true}) {
        if ((width == 1 && big) || width + 4 > period) continue;
        add_counter(c, width, big, false);
        if (width == 8) add_counter(c, width, big, true);
      }
    double same = 0;
    for (std::size_t width = 1; width <= 4 && width < period; ++width) {
      FieldFound skipped{.field = {FrameField::Is::skip, width, ""}, .width = width};
      same += 9 + constant(c + width - 1), skipped.bits = 20 + same;
      if (same < kNever) fields_[c].push_back(skipped);
      skipped.bits = 20 + 8.0 * static_cast<double>(width * (steps_ + 1)), skipped.sure = false;
      fields_[c].push_back(skipped);
    }
  }
}

bool BinaryColumns::is_checksum(const std::string& kind, bool big_endian, std::size_t begin,
                                std::size_t end) const {
  const std::size_t width = checksum_bytes(kind), rows = steps_ + (end + width > stretch_.period ? 0 : 1);
  std::vector<std::uint32_t> seen;
  std::size_t right = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const auto *from = at(k, begin), *place = at(k, end);
    const auto sent = static_cast<std::uint32_t>(load(place, width, big_endian));
    if (sent == checksum_of(kind, std::as_bytes(std::span(from, end - begin)))) {
      ++right;
      if (seen.size() < 8 && std::ranges::find(seen, sent) == seen.end()) seen.push_back(sent);
    } else if (k < 3 ? k - right > 0
                     : static_cast<double>(k + 1 - right) > kMostExceptions * static_cast<double>(rows)) {
      return false;
    }
  }
  return 8 * width * seen.size() >= 40;
}

}  // namespace supertac
