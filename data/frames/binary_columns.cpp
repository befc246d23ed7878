#include "data/frames/binary_columns.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "data/frames/binary_decoder.h"
#include "data/frames/probe.h"
#include "io/numbers/median.h"

namespace supertac {
namespace {

double log2_gamma(double x) { return std::lgamma(x) / std::log(2.0); }

}  // namespace

double bits_of_share(double a, double b) {
  return log2_gamma(a + b + 1) + 2 * log2_gamma(0.5) - log2_gamma(a + 0.5) - log2_gamma(b + 0.5);
}

namespace {

constexpr std::size_t kClasses = 34;
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

// Code length of steps of these classes, each as often as it is expected after those before, and within it.
// That nothing ever moves is coded with the array.
double bits_of_steps(const std::array<std::size_t, kClasses>& counts, std::size_t classes,
                     std::size_t steps) {
  if (counts[0] == steps) return 0;
  const double share = 1.0 / static_cast<double>(classes);
  double bits = log2_gamma(static_cast<double>(steps) + 1);
  for (std::size_t c = 0; c < classes; ++c)
    if (counts[c] > 0)
      bits += log2_gamma(share) - log2_gamma(static_cast<double>(counts[c]) + share) +
              static_cast<double>(counts[c] * c);
  return bits;
}

// A sensor's numbers lie within 24 powers of two from 1; each beyond costs a bit.
double bits_of_size(double x) {
  if (x == 0) return 0;
  return std::isfinite(x) ? std::max(0.0, std::abs(std::log2(std::abs(x))) - 24) : 128;
}

template <class Unsigned>
Unsigned load(const unsigned char* bytes, bool big_endian) {
  Unsigned value = 0;
  for (std::size_t i = 0; i < sizeof value; ++i)
    value = static_cast<Unsigned>(value << 7 << 1 | bytes[big_endian ? i : sizeof value - 1 - i]);
  return value;
}

// Numbers in their order: real numbers as how many there are up to 0.
template <class Number>
std::int64_t ordinal(std::make_unsigned_t<Number> bits) {
  return std::int64_t{static_cast<Number>(bits)};
}
std::int64_t ordinal_of_real(std::uint32_t bits) {
  const std::int64_t size = bits & 0x7FFFFFFF;
  return bits >> 31 != 0 ? -size : size;
}

// A column read as numbers: bits of its steps in time, and of a number in its middle, for what came first may
// be no frame: alone, and for its size.
struct Column {
  double steps = 0, alone = 0, size = 0;
  std::int64_t middle = 0;
  bool still = false, sign = false, began_signed = true;
};
template <class Unsigned, class Ordinal>
Column column_of(const unsigned char* first, std::size_t stride, std::size_t steps, bool big_endian,
                 const Ordinal& ordinal) {
  constexpr std::size_t kBits = 8 * sizeof(Unsigned);
  std::array<std::size_t, kClasses> counts{};
  Column column{.middle = ordinal(load<Unsigned>(first + steps / 2 * stride, big_endian))};
  std::int64_t before = ordinal(load<Unsigned>(first, big_endian));
  for (std::size_t k = 0; k <= steps; ++k) {
    const auto bits = load<Unsigned>(first + k * stride, big_endian);
    const bool sign = bits >> (kBits - 1) != 0;
    column.sign = column.sign || sign;
    if (k < 3) column.began_signed = column.began_signed && sign;
    const std::int64_t now = ordinal(bits);
    const int size = std::bit_width(static_cast<std::uint64_t>(std::abs(now - before)));
    // Far is far.
    if (k > 0) ++counts[size + 2 > static_cast<int>(kBits) ? kBits : static_cast<std::size_t>(size)];
    before = now;
  }
  column.steps = bits_of_steps(counts, kBits + 2, steps), column.still = counts[0] == steps;
  column.alone = std::log2(kBits + 1.0) + std::bit_width(static_cast<std::uint64_t>(std::abs(column.middle)));
  column.size = bits_of_size(static_cast<double>(column.middle));
  return column;
}

// Real numbers may all be multiples of one, such as whole numbers.
void look_at_multiples(Column& column, const unsigned char* first, std::size_t stride, std::size_t steps,
                       bool big_endian) {
  const auto value = [&](std::size_t k) {
    return std::bit_cast<float>(load<std::uint32_t>(first + k * stride, big_endian));
  };
  const auto finite = [&](std::size_t k) { return std::isfinite(value(k)); };
  column.size = bits_of_size(double{value(steps / 2)});
  int finest = 127;
  for (std::size_t k = 0; k <= steps; ++k) {
    if (!finite(k) || value(k) == 0) continue;
    const auto mantissa = (std::bit_cast<std::uint32_t>(value(k)) & 0x7FFFFF) | 0x800000;
    finest = std::min(finest, std::max(std::ilogb(value(k)) - 23, -149) + std::countr_zero(mantissa));
  }
  std::array<std::size_t, kClasses> counts{};
  for (std::size_t k = 1; k <= steps; ++k) {
    const double n = finite(k) && finite(k - 1)
                         ? std::ldexp(std::abs(double{value(k)} - double{value(k - 1)}), -finest)
                         : std::ldexp(1.0, 32);
    ++counts[n < 1 ? 0 : std::min<std::size_t>(static_cast<std::size_t>(std::ilogb(n)) + 1, 32)];
  }
  column.steps = std::min(column.steps, bits_of_steps(counts, kClasses, steps));
}

// Bits of how far a number is from the one before it in the frame.
double apart(const Column& a, const Column& b, std::size_t bits) {
  return std::log2(static_cast<double>(bits + 1)) +
         std::bit_width(static_cast<std::uint64_t>(std::abs(a.middle - b.middle)));
}

}  // namespace

BinaryColumns::BinaryColumns(Bytes bytes, const Stretch& stretch, double seconds)
    : bytes_(bytes), stretch_(stretch), steps_(stretch.rows - 2) {
  find_constants();
  find_values();
  find_fields(seconds);
}

void BinaryColumns::find_constants() {
  const std::size_t period = stretch_.period;
  constant_.assign(period, kNever), usual_.resize(period);
  for (std::size_t c = 0; c < period; ++c) {
    std::array<std::size_t, 256> counts{};
    for (std::size_t k = 0; k <= steps_; ++k) ++counts[*at(k, c)];
    const auto usual = std::ranges::max_element(counts);
    usual_[c] = static_cast<unsigned char>(usual - counts.begin());
    Exceptions others;
    for (std::size_t k = 0; k <= steps_; ++k)
      others.add(*at(k, c) != usual_[c], k > 0 && *at(k, c) == *at(k - 1, c));
    if (!others.too_many()) constant_[c] = others.bits(8);
  }
}

void BinaryColumns::find_values() {
  const std::size_t period = stretch_.period;
  const auto read = [&](const std::string& type, const unsigned char* first, bool big) {
    if (type == "f32") {
      Column column = column_of<std::uint32_t>(first, period, steps_, big, ordinal_of_real);
      look_at_multiples(column, first, period, steps_, big);
      return column;
    }
    return type == "u8"    ? column_of<std::uint8_t>(first, period, steps_, big, ordinal<std::uint8_t>)
           : type == "i8"  ? column_of<std::uint8_t>(first, period, steps_, big, ordinal<std::int8_t>)
           : type == "u16" ? column_of<std::uint16_t>(first, period, steps_, big, ordinal<std::uint16_t>)
           : type == "i16" ? column_of<std::uint16_t>(first, period, steps_, big, ordinal<std::int16_t>)
           : type == "u32" ? column_of<std::uint32_t>(first, period, steps_, big, ordinal<std::uint32_t>)
                           : column_of<std::uint32_t>(first, period, steps_, big, ordinal<std::int32_t>);
  };
  for (const char* type : {"u8", "i8", "u16", "i16", "u32", "i32", "f32"})
    for (const bool big : {false, true}) {
      const std::size_t width = bytes_of(type);
      if ((width == 1 && big) || width > period) continue;
      Values v{type, big, width};
      std::vector<Column> columns(period);
      for (std::size_t c = 0; c < period; ++c) {
        columns[c] = read(type, at(0, c), big);
        v.sign.push_back(columns[c].sign), v.rests_signed.push_back(columns[c].began_signed);
        v.first.push_back(columns[c].alone + columns[c].size + columns[c].steps);
      }
      for (std::size_t c = 0; c < 2 * period; ++c) {
        const Column &here = columns[c % period], &before = columns[(c + period - width) % period];
        v.behind.push_back(here.steps + here.size + apart(here, before, 8 * width) +
                           (c >= width ? v.behind[c - width] : 0));
        v.still.push_back((here.still ? 1 : 0) + (c >= width ? v.still[c - width] : 0));
      }
      values_.push_back(std::move(v));
    }
}

double BinaryColumns::Values::bits(std::size_t at, std::size_t count) const {
  const std::size_t end = at + (count - 1) * width;
  const double still_ones = still[end] - (at >= width ? still[at - width] : 0);
  return first[at] + behind[end] - behind[at] +
         bits_of_share(still_ones, static_cast<double>(count) - still_ones);
}

void BinaryColumns::add_counter(std::size_t column, std::size_t width, bool big_endian, double seconds) {
  const std::string type = "u" + std::to_string(8 * width);
  const auto* first = at(0, column);
  const auto number = [&](std::size_t k) {
    const auto* from = first + k * stretch_.period;
    return width == 1   ? std::uint64_t{*from}
           : width == 2 ? std::uint64_t{load<std::uint16_t>(from, big_endian)}
           : width == 4 ? std::uint64_t{load<std::uint32_t>(from, big_endian)}
                        : load<std::uint64_t>(from, big_endian);
  };
  const std::uint64_t mask = width == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << 8 * width) - 1;
  const double begin = std::bit_width(number(0));
  std::vector<double> steps;
  Exceptions not_one;
  for (std::size_t k = 1; k <= steps_; ++k) {
    steps.push_back(static_cast<double>((number(k) - number(k - 1)) & mask));
    not_one.add(steps.back() != 1);
  }
  if (width < 8 && !not_one.too_many()) {
    FieldFound found{{FrameField::Is::counter, 0, type}, {}, width, 4 + begin + not_one.bits(begin)};
    fields_[column].push_back(found);
    return;
  }
  // Its lowest byte moves; and it began in a year that a computer knows.
  if (width == 1 || constant(big_endian ? column + width - 1 : column) < kNever) return;
  // A clock goes on, evenly but for a few steps, and about as fast as the host's.
  const double usual = median(std::vector<double>(steps));
  if (usual < 1 || usual > std::min(static_cast<double>(mask) / 4, 1e9)) return;
  std::array<std::size_t, kClasses> counts{};
  double went = 0;
  Exceptions jumps;
  for (const double step : steps) {
    const double away = std::abs(step - usual);
    const bool jump = away > 3 * usual + 2;
    jumps.add(jump);
    if (!jump) went += step;
    ++counts[jump ? 0 : std::bit_width(static_cast<std::uint64_t>(away))];
  }
  if (went <= 0 || jumps.too_many()) return;
  const double mean = went / static_cast<double>(steps_);
  FieldFound found{{FrameField::Is::time, 0, ""},
                   {.type = type},
                   width,
                   (width == 4   ? 4
                    : width == 2 ? 12
                                 : 6) +
                       2 * begin + jumps.bits(2 * begin) + bits_of_steps(counts, kClasses, steps_)};
  double best = kNever, second = kNever;
  for (const double unit : {1e-3, 1e-6}) {
    const double rate = 1 / (mean * unit), ratio = went * unit / std::max(seconds, 1e-9);
    if (rate < 0.3 || rate > 50'000 || static_cast<double>(number(0)) * unit > 1e10) continue;
    double odds = std::pow(std::log10(rate / 100), 2);  // frames come 10 to 1000 times a second
    if (seconds >= kAtOnceS) odds = ratio > 0.75 && ratio < 1.25 ? 0 : kNever;
    if (odds < best)
      second = best, best = odds, found.time.unit_s = unit;
    else
      second = std::min(second, odds);
  }
  found.sure = second - best > 3;
  if (best == kNever) {  // linear, but in no unit that is known
    found.field = {FrameField::Is::skip, width, ""}, found.time = {}, found.bits += 20, found.sure = true;
  }
  fields_[column].push_back(found);
}

void BinaryColumns::find_fields(double seconds) {
  const std::size_t period = stretch_.period;
  fields_.resize(period);
  for (std::size_t c = 0; c < period; ++c) {
    for (const std::size_t width : {1, 2, 4, 8})
      for (const bool big : {false, true}) {
        if (width == 1 && big) continue;
        if (width + 4 > period) continue;
        const std::size_t before = fields_[c].size();
        add_counter(c, width, big, seconds);
        for (std::size_t k = before; k < fields_[c].size(); ++k) fields_[c][k].big_endian = big;
      }
    double same = 0;
    for (std::size_t width = 1; width <= kMostSkipped && width < period; ++width) {
      same += 9 + constant(c + width - 1);
      if (same < kNever) fields_[c].push_back({{FrameField::Is::skip, width, ""}, {}, width, 20 + same});
      fields_[c].push_back({{FrameField::Is::skip, width, ""},
                            {},
                            width,
                            20 + 8.0 * static_cast<double>(width * (steps_ + 1)),
                            false});
    }
  }
}

bool BinaryColumns::is_checksum(const std::string& kind, bool big_endian, std::size_t begin,
                                std::size_t end) const {
  const std::size_t width = checksum_bytes(kind), rows = steps_ + (end + width > stretch_.period ? 0 : 1);
  std::vector<double> seen;
  std::size_t right = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const auto *from = at(k, begin), *place = at(k, end);
    const double sent = width == 1   ? *place
                        : width == 2 ? load<std::uint16_t>(place, big_endian)
                                     : load<std::uint32_t>(place, big_endian);
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
