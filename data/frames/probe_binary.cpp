// What a binary stream is: of all readings - header, fields, values, checksum, trailer - the one that
// describes the bytes in the fewest bits.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "data/frames/binary_columns.h"
#include "data/frames/binary_decoder.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kLongestHeader = 4, kLongestTrailer = 4;
constexpr double kClearLead = 8, kMostLead = 40;

// A byte of a header or a trailer, beside another of it (below 0 for none): what people take for them costs
// fewer bits than other bytes, and what goes on as its neighbour does - the complement, the next number, one
// more letter - fewer yet.
double bits_of_mark(unsigned char byte, int beside) {
  constexpr unsigned char kOften[] = {0xAA, 0x55, 0xA5, 0x5A, 0xFF, 0xFE, 0xFA, 0xC3, 0x3C, 0x7E,
                                      0x24, 0x02, 0xEB, 0x90, 0xBB, 0xCC, 0xDD, 0xEE, 0xFD, 0xFC,
                                      0xF0, 0x5B, 0x7B, 0x23, 0x03, 0x10, 0x0A, 0x0D};
  const auto is_letter = [](int c) {
    return lower(static_cast<char>(c)) >= 'a' && lower(static_cast<char>(c)) <= 'z';
  };
  if (beside + byte == 255 || beside == byte + 1 || beside == byte - 1) return 2;
  if (std::ranges::find(kOften, byte) != std::end(kOften)) return 4;
  if (beside > 0 && is_letter(beside) && is_letter(byte)) return 5;
  return byte == 0 ? 12 : 8.5;
}
// Of one before `behind`, below 0 for the last.
double bits_of_trailer(unsigned char byte, int behind) {
  const bool ends = (byte == '\r' || byte == '\n') && (behind < 0 || behind == '\r' || behind == '\n');
  return ends ? 1 : byte == 0 ? kNever : bits_of_mark(byte, behind);
}

// People build arrays of some sides more often than of others, and square ones most often; kNever where no
// array has so many values.
double bits_of_count(std::size_t count) {
  const auto weight = [](std::size_t side) {
    for (const std::size_t often : {4, 8, 16, 32, 64})
      if (side == often) return 8.0;
    for (const std::size_t at_times : {1, 2, 3, 5, 6, 10, 12, 20, 24, 48})
      if (side == at_times) return 4.0;
    return 28.0 / static_cast<double>(side);
  };
  double sum = 0;
  for (const auto& [channels, share] : {std::pair(1, 0.9), {3, 0.08}, {2, 0.02}}) {
    if (count % static_cast<std::size_t>(channels) != 0) continue;
    const std::size_t taxels = count / static_cast<std::size_t>(channels);
    for (std::size_t rows = 1; rows <= 64; ++rows)
      if (taxels % rows == 0 && taxels / rows <= 64)
        sum += share * weight(rows) * weight(taxels / rows) * (rows * rows == taxels ? 3 : 1);
  }
  return sum > 0 ? -std::log2(sum / (129 * 129)) : kNever;
}

double bits_of_type(const std::string& type) {
  return type == "u8" || type == "u16" ? 1.5 : type == "i16" || type == "f32" ? 3 : 5;
}

struct Checksum {
  const char* kind = "none";
  bool big_endian = false;
  bool foreign = false;  // a byte that follows from all others in a way that no sensor's file can say
};

// A reading as far as it is made: what is left from `begin` to `end` are values, or fields beside them.
struct Partly {
  std::size_t start = 0, header = 0, trailer = 0;
  double end_bits = 0, field_bits = 0;
  Checksum checksum = {};
  std::size_t from = 0;  // bytes of the header that the checksum does not cover
  std::size_t begin = 0, end = 0;
  std::array<const FieldFound*, 2> found = {};
  std::size_t before = 0, all = 0;  // of the fields found: those before the values come first

  std::span<const FieldFound* const> fields() const { return std::span(found).first(all); }
  Partly with(const FieldFound& field, bool is_before) const {
    Partly more = *this;
    more.found[more.all++] = &field, more.field_bits += field.bits;
    if (is_before)
      ++more.before, more.begin += field.width;
    else
      more.end -= field.width;
    return more;
  }
};

// Of one period.
class Search {
 public:
  Search(Bytes bytes, const BinaryColumns& columns, std::vector<double> start_bits,
         std::optional<std::size_t> values)
      : columns_(columns),
        period_(columns.stretch().period),
        start_bits_(std::move(start_bits)),
        counts_(period_ + 1, -1),
        wanted_(values),
        sent_(8.0 * static_cast<double>(bytes.size())),
        outside_(8.0 * static_cast<double>(bytes.size() - (columns.stretch().rows - 1) * period_)) {
    find_checksums();
    for (std::size_t end = 0; end < period_; ++end) foreign_sums_.push_back(columns.foreign_sum(end));
  }

  // Into `found`: the best of each kind that reads other numbers.
  void run(std::vector<BinaryReading>& found) {
    for (std::size_t start = 0; start < period_; ++start) {
      double trailer_bits = 0;
      for (std::size_t trailer = 0; trailer <= kLongestTrailer && trailer + 4 < period_; ++trailer) {
        constexpr double kLonger[] = {0, 3, 0, 2, 2};  // than a trailer of a byte less
        const std::size_t at = start + period_ - trailer;
        if (trailer > 0)
          trailer_bits += columns_.constant(at) +
                          bits_of_trailer(columns_.usual(at), trailer == 1 ? -1 : columns_.usual(at + 1)) +
                          kLonger[trailer];
        if (trailer_bits == kNever) break;
        try_headers(start, trailer, trailer_bits);
      }
    }
    for (auto& [key, reading] : best_) found.push_back(reading);
  }

 private:
  void find_checksums() {
    std::size_t summed = 0;  // bytes; 150 million take some tenths of a second
    for (std::size_t end = 0; end < period_; ++end)
      for (const char* kind : kChecksums) {
        const std::size_t width = checksum_bytes(kind);
        if (width == 0 || width + 3 >= period_ || columns_.constant(end) == 0) continue;
        // What stands between a checksum and where the next one begins stays the same.
        for (std::size_t gap = 0; summed < 150'000'000 && gap <= kLongestTrailer + kLongestHeader; ++gap) {
          if (gap > 0 && columns_.constant(end + width + gap - 1) == kNever) break;
          const std::size_t begin = end + width + gap, from = begin >= period_ ? begin - period_ : begin;
          const std::size_t to = from < end ? end : end + period_;
          summed += width > 1 ? 2 * period_ : period_;
          for (const bool big : {false, true})
            if ((width > 1 || !big) && columns_.is_checksum(kind, big, from, to))
              checksums_.try_emplace({end, gap}, Checksum{kind, big});
        }
      }
  }

  void try_headers(std::size_t start, std::size_t trailer, double trailer_bits) {
    double header_bits = 0;
    for (std::size_t header = 0; header <= kLongestHeader && header + trailer + 3 < period_; ++header) {
      constexpr double kLengths[] = {6, 2, 1, 2.5, 2};
      if (header == 1 && columns_.usual(start) == 0) break;  // nobody begins a frame by 0
      if (header > 0)
        header_bits += columns_.constant(start + header - 1) +
                       bits_of_mark(columns_.usual(start + header - 1),
                                    header == 1 ? -1 : columns_.usual(start + header - 2));
      if (header_bits == kNever) break;
      const Partly plain{
          .start = start,
          .header = header,
          .trailer = trailer,
          .end_bits = outside_ + trailer_bits + header_bits + kLengths[header] + start_bits_[start],
          .begin = start + header,
          .end = start + period_ - trailer};
      if (header + trailer > 0) {
        try_fields(plain);
        Partly summed = plain;
        summed.checksum.foreign = true, summed.end -= 1,
        summed.end_bits += foreign_sums_[summed.end % period_];
        try_fields(summed);
      }
      for (const std::size_t width : {1, 2, 4}) {
        if (header + trailer + width + 2 > period_) continue;
        const std::size_t end = (start + 2 * period_ - trailer - width) % period_;
        for (std::size_t from = 0; from <= header; ++from) {
          const auto at = checksums_.find({end, trailer + from});
          if (at == checksums_.end() || checksum_bytes(at->second.kind) != width) continue;
          Partly summed = plain;
          summed.checksum = at->second, summed.from = from, summed.end -= width;
          // That all of a header is covered, or nothing of it, is usual.
          summed.end_bits += from == 0 || from == header ? 6 : 10;
          try_fields(summed);
        }
      }
    }
  }

  void try_fields(const Partly& p) {
    if (p.begin >= p.end || p.end_bits + p.field_bits > least_ + kMostLead) return;
    try_values(p);
    if (p.all == p.found.size()) return;
    for (std::size_t width = 1; width <= 8 && p.begin + width < p.end; ++width)
      for (const FieldFound& field : columns_.fields(p.end - width))
        if (field.width == width && allowed(field, p)) try_fields(p.with(field, false));
    if (p.all > p.before || (p.all > 0 && p.found[0]->unknown())) return;
    for (const FieldFound& field : columns_.fields(p.begin))
      if (allowed(field, p)) try_fields(p.with(field, true));
  }
  // One clock; bytes of no meaning once; and in long periods not at all, for there time counts.
  bool allowed(const FieldFound& field, const Partly& p) const {
    if (field.unknown() && (period_ > 600 || p.all > 0)) return false;
    return std::ranges::none_of(p.fields(), [&](const FieldFound* other) {
      return other->field.is == field.field.is &&
             (field.field.is == FrameField::Is::skip || field.field.is == FrameField::Is::time);
    });
  }

  void try_values(const Partly& p) {
    for (const BinaryColumns::Values& values : columns_.values()) {
      if ((p.end - p.begin) % values.width != 0) continue;
      const std::size_t count = (p.end - p.begin) / values.width, at = p.begin % period_;
      if (wanted_ && *wanted_ != count) continue;
      if (counts_[count] < 0) counts_[count] = bits_of_count(count);
      double all =
          p.end_bits + p.field_bits + values.bits(at, count) + counts_[count] + bits_of_type(values.type);
      if (!(all < least_ + kMostLead)) continue;
      bool big = values.width > 1 && values.big_endian, little = values.width > 1 && !values.big_endian;
      std::size_t clock = 0;  // two readings of the time are two readings
      for (std::size_t k = 0; k < p.all; ++k) {
        const FieldFound& field = *p.found[k];
        if (field.field.is == FrameField::Is::time)
          clock = field.width + (field.big_endian ? 16 : 0) + (k >= p.before ? 32 : 0);
        if (field.width > 1 && field.field.is != FrameField::Is::skip)
          (field.big_endian ? big : little) = true;
      }
      if (big && little) all += kClearLead;  // hardly anybody mixes byte orders
      least_ = std::min(least_, all);
      // Random numbers are no signal. Below 0 there is more than a mark that stands for an error.
      bool random = false, is_signed = false, sure = false;
      for (std::size_t k = 0; k < count; ++k) {
        const BinaryColumns::Place& place = values.places[at + k * values.width];
        random = random || place.random, is_signed = is_signed || place.high;
        sure = sure || (place.high && place.highs);
      }
      is_signed = is_signed && values.type.front() == 'i';
      const auto key = std::tuple(at, count, values.width, values.width > 1 && values.big_endian,
                                  (values.type.front() == 'f' ? 2 : std::size_t{is_signed}) + 4 * clock);
      const auto known = best_.find(key);
      if (known != best_.end() && known->second.bits <= all) continue;
      BinaryReading& found = best_[key] = reading(p, values, count);
      found.bits = all, found.mixed = big && little, found.sign_unsure = is_signed && !sure;
      found.unknown = found.unknown || random;
    }
  }

  BinaryReading reading(const Partly& p, const BinaryColumns::Values& values, std::size_t count) const {
    BinaryReading r;
    r.values = count, r.period = period_, r.sent = sent_;
    FrameFormat& f = r.format;
    f.kind = FrameKind::binary;
    for (std::size_t i = 0; i < p.header; ++i) f.header += static_cast<char>(columns_.usual(p.start + i));
    for (std::size_t i = p.trailer; i > 0; --i)
      f.trailer += static_cast<char>(columns_.usual(p.start + period_ - i));
    f.type = values.type, f.big_endian = values.big_endian;
    const auto add = [&](const FieldFound& field) {
      f.fields.push_back(field.field);
      if (field.field.is == FrameField::Is::time) {
        f.time = field.time, r.unit_assumed = !field.sure;
        if (values.width == 1) f.big_endian = field.big_endian;
      }
      r.unknown = r.unknown || field.field.is == FrameField::Is::skip;
    };
    for (std::size_t k = 0; k < p.before; ++k) add(*p.found[k]);
    f.fields.push_back({FrameField::Is::values, count, ""});
    for (std::size_t k = p.all; k-- > p.before;) add(*p.found[k]);
    if (p.checksum.foreign) f.fields.push_back({FrameField::Is::skip, 1, ""});
    r.foreign_sum = p.checksum.foreign;
    const bool plain =
        f.fields.size() == 1 || (f.fields.size() == 2 && f.fields[0].is == FrameField::Is::time);
    if (plain) f.fields.clear();
    f.checksum = p.checksum.kind;
    if (f.checksum != "none" && p.from != p.header) f.checksum_from = p.from;
    if (checksum_bytes(f.checksum) > 1 && p.checksum.big_endian != f.big_endian)
      f.checksum_big_endian = p.checksum.big_endian;
    return r;
  }

  const BinaryColumns& columns_;
  std::size_t period_;
  std::vector<double> start_bits_, counts_;
  std::optional<std::size_t> wanted_;
  double sent_, outside_, least_ = kNever;
  std::map<std::pair<std::size_t, std::size_t>, Checksum> checksums_;
  std::vector<double> foreign_sums_;  // costs, by their place
  std::map<std::tuple<std::size_t, std::size_t, std::size_t, bool, std::size_t>, BinaryReading> best_;
};

// Readings of the bytes, the best first, no two of which give the same numbers. Header (0 to 4 bytes),
// clock, counter, type, byte order, count, checksum and what it covers, and trailer are found at once, by
// the length of the bytes' description (binary_columns.h).
std::vector<BinaryReading> binary_readings(Bytes all, std::span<const Heard> heard,
                                           std::optional<std::size_t> values) {
  const double seconds = heard.back().time_s - heard.front().time_s;
  const std::size_t first = all.size() - std::min(all.size(), std::size_t{1} << 18);
  const Bytes bytes = all.subspan(first);
  std::vector<BinaryReading> found;
  for (const std::size_t period : periods_of(bytes)) {
    const ByteStretch stretch = stretch_of(bytes, period);
    if (stretch.rows < 8) continue;
    const double share = static_cast<double>((stretch.rows - 2) * period) / static_cast<double>(all.size());
    const BinaryColumns columns(bytes, stretch, seconds < kAtOnceS ? 0 : seconds * share);
    Search(bytes, columns, bits_of_starts(heard, first, stretch, seconds, all.size()), values).run(found);
  }
  std::ranges::sort(found, {}, &BinaryReading::bits);
  return found;
}

}  // namespace

std::string BinaryReading::text() const {
  const FrameFormat& f = format;
  std::string text = f.header.empty() ? "no header" : "header " + hex_of_bytes(f.header);
  for (const FrameField& field : f.fields) {
    if (field.is == FrameField::Is::counter) text += ", a counter " + field.type;
    if (field.is == FrameField::Is::skip)
      text += ", " + std::to_string(field.count) + " bytes that are no value";
  }
  if (f.time) text += ", a clock " + f.time->type + " in " + supertac::format(f.time->unit_s) + " s";
  text += ", " + std::to_string(values) + " values " + f.type;
  if (f.type.back() != '8') text += f.big_endian ? " big-endian" : " little-endian";
  if (f.checksum != "none") text += ", checksum " + f.checksum;
  if (!f.trailer.empty()) text += ", trailer " + hex_of_bytes(f.trailer);
  return text + " (explains " + supertac::format(100 * (1 - bits / sent), 0) + " % of the bytes)";
}

std::optional<BinaryReading> find_binary_format(Bytes bytes, std::span<const Heard> heard,
                                                std::optional<std::size_t> values,
                                                std::vector<std::string>& says) {
  if (const std::string framing = framing_of(bytes); !framing.empty()) {
    says.push_back("frames in " + framing + ", which replaces bytes within them: no sensor's file " +
                   "can say so; let the sensor send frames of one size");
    return std::nullopt;
  }
  const std::vector<BinaryReading> found = binary_readings(bytes, heard, values);
  if (found.empty() || found[0].bits > found[0].sent - kMostLead) {
    says.push_back("binary without a period: a wrong baud rate, an unknown checksum or type, or no sensor");
    return std::nullopt;
  }
  // Bytes that jump between two levels may be as short with a sign as without: as most, they then have none.
  const auto twin = std::ranges::find_if(found, [&](const BinaryReading& r) {
    return &r != &found[0] && r.bits < found[0].bits + kClearLead && r.values == found[0].values &&
           r.format.type.substr(1) + found[0].format.type.substr(1) == "88" &&
           r.format.fields.size() == found[0].format.fields.size();
  });
  const bool sign_assumed = twin != found.end();
  const BinaryReading& best = sign_assumed && twin->format.type == "u8" ? *twin : found[0];
  // Values of a byte may rest at letters; a word reaches into what is no value.
  const std::string marks = best.format.header + best.format.trailer;
  const bool lettered = std::ranges::any_of(marks, [](char c) { return lower(c) >= 'a' && lower(c) <= 'z'; });
  const std::string word = lettered || best.format.type.back() != '8' ? word_in(bytes, best.period) : "";
  if (!word.empty()) {
    says.push_back("frames with words, as " + in_quotes(word) + ": OSC, MessagePack or the like, which no " +
                   "sensor's file can describe; let the sensor send numbers alone, or as text");
    return std::nullopt;
  }
  // A part of the period is never outweighed; fewer values in the same bytes by 11 bits: what never
  // moves at the edge is a dead taxel or a mark, and only the shape of the array speaks for one of them.
  const auto rival = std::ranges::find_if(found, [&](const BinaryReading& r) {
    return (r.period < best.period && best.period % r.period == 0) ||
           (r.period == best.period && r.format.type == best.format.type && r.values < best.values &&
            r.bits < best.bits + 11);
  });
  const auto next = std::ranges::find_if(found, [&](const BinaryReading& r) {
    return &r != &best && !(sign_assumed && (&r == &found[0] || &r == &*twin));
  });
  const BinaryReading* second = rival != found.end() ? &*rival : next != found.end() ? &*next : nullptr;
  const double lead = rival != found.end() ? 0 : second != nullptr ? second->bits - best.bits : kMostLead;
  const bool seven = holds_seven_bits(best, heard);
  if (lead < kClearLead || best.unknown || best.mixed || best.sign_unsure || seven) {
    says.push_back("it may be: " + best.text());
    if (best.mixed) says.push_back("but its fields have two byte orders, which no sensor's file can say");
    if (seven) says.push_back("but its bytes hold seven bits each, which no sensor's file can say");
    if (best.sign_unsure) says.push_back("but whether its numbers have a sign cannot be told");
    if (best.unknown)
      says.push_back("but some bytes have no meaning that is known, such as another checksum");
    if (lead < kClearLead) says.push_back("or as well: " + second->text());
    says.push_back(
        "nothing is drafted: press many taxels while it listens, longer (--seconds), or write the file");
    return std::nullopt;
  }
  says.push_back("binary: " + best.text());
  if (second != nullptr) says.push_back("the next best reading: " + second->text());
  if (best.foreign_sum)
    says.push_back("a byte behind the values is a sum that no sensor's file can say: it is not checked");
  if (sign_assumed)
    says.push_back("assumed: its numbers have no sign, though i8 explains as much; set \"frame.type\"");
  if (best.unit_assumed)
    says.push_back("assumed: its clock counts units of " + format(best.format.time->unit_s) +
                   " s; a file does not tell; set \"frame.time.unit\"");
  return best;
}

}  // namespace supertac
