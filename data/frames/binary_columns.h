// What stands in the columns of a binary stream once it is cut into periods, in bits: the shorter a reading
// describes the bytes, the better it explains them.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/frames/probe.h"

namespace supertac {

using Bytes = std::span<const unsigned char>;
inline constexpr double kNever = std::numeric_limits<double>::infinity();  ///< bits of what is not so
inline constexpr std::size_t kClasses = 34;                                ///< of powers of two

/// Bits that tell which of a + b events were of one kind (a of them) and which of the other (b), where each
/// is expected as often as those before it say: after i of one kind and j of the other, the next is of the
/// first with p = (i + 1/2) / (i + j + 1) (Krichevsky and Trofimov 1981). The product of all p gives
///   -log2 p(a, b) = log2( G(a + b + 1) G(1/2)^2 / (G(a + 1/2) G(b + 1/2)) ),   G the gamma function
double bits_of_share(double a, double b);

/// The periods, in bytes, that may be frames: those after which more bytes return than after others, the
/// likeliest first, none of them only a multiple of another.
std::vector<std::size_t> periods_of(Bytes bytes);

/// "SLIP", "HDLC" or "COBS", which replace bytes within frames, where what stands between their marks has one
/// size only when that is undone; empty else.
std::string framing_of(Bytes bytes);
/// The letters that stand at one place of all frames, `period` bytes each, more than any header has; empty
/// where there are none, or one letter again and again, as of dead taxels.
std::string word_in(Bytes bytes, std::size_t period);

/// Periods in a row in which nothing was lost.
struct ByteStretch {
  std::size_t period = 0, begin = 0, rows = 0;
};
/// The longest one: the bytes that return a period later outweigh what returns by chance.
ByteStretch stretch_of(Bytes bytes, std::size_t period);

/// What came after a pause begins a frame: cost of where the pauses ended, for each byte of the period. The
/// first of `bytes` bytes that are looked at is `first_byte` of those heard.
std::vector<double> bits_of_starts(std::span<const Heard> heard, std::size_t first_byte,
                                   const ByteStretch& stretch, double seconds, std::size_t bytes);

/// A field that is no value, as it may stand in a period from some byte on.
struct FieldFound {
  FrameField field = {};
  FrameTime time = {};  ///< of a clock
  std::size_t width = 0;
  double bits = 0;
  bool sure = true;  ///< false for a clock whose unit is only likely, and for bytes of no known meaning
  bool big_endian = false;
  bool unknown() const { return field.is == FrameField::Is::skip && !sure; }
};

/// Costs in bits of the columns of a stretch. A signal costs what its steps in time do - how large each is,
/// by classes of powers of two as often as the column has them, and which of its class - and once how far it
/// is from the signal before it in the frame, by classes as often as the array has them: taxels side by side
/// rest alike, and move smoothly. Read in another width, byte order or place they do neither.
class BinaryColumns {
 public:
  /// `seconds`: what the stretch took, 0 where it came at once.
  BinaryColumns(Bytes bytes, const ByteStretch& stretch, double seconds);

  /// A value that begins at a byte of the period, or of the one behind it.
  struct Place {
    double alone = 0;  ///< cost of where it rests, of which no other is known
    /// Cost of the steps in time, values that never move, and counts of how far values rest from those before
    /// them, by classes: sums of all places a width apart up to this one.
    double moves = 0, still = 0;
    std::array<std::uint16_t, kClasses> apart = {};
    bool random = false;               ///< its steps take more bits than its bytes: no signal
    bool high = false, highs = false;  ///< its highest bit is set at times; in several numbers
  };
  /// As values of one type.
  struct Values {
    std::string type;
    bool big_endian = false;
    std::size_t width = 0;
    std::vector<Place> places = {};  ///< [2 period]
    /// Cost of `count` values from byte `at`, below the period, on: and of how many of them never move.
    double bits(std::size_t at, std::size_t count) const;
  };
  const std::vector<Values>& values() const { return values_; }
  /// Cost of exceptions of a byte that stays the same, kNever where it does not; and its value.
  double constant(std::size_t at) const { return constant_[at % stretch_.period]; }
  unsigned char usual(std::size_t at) const { return usual_[at % stretch_.period]; }
  /// Counters, clocks, constants and bytes of no known meaning that begin at a byte of the period.
  const std::vector<FieldFound>& fields(std::size_t at) const { return fields_[at % stretch_.period]; }
  /// Whether a checksum of this kind at byte `end` of the period is right for the bytes from `begin` on.
  bool is_checksum(const std::string& kind, bool big_endian, std::size_t begin, std::size_t end) const;
  /// Cost of the byte at `at` of the period where it follows from the period's bytes that end with it, kNever
  /// where it does not: as their sum plus a constant, or that negated, modulo 256 (two's complement) or 255
  /// (ones'), or as their exclusive or with a constant.
  double foreign_sum(std::size_t at) const;
  const ByteStretch& stretch() const { return stretch_; }

 private:
  const unsigned char* at(std::size_t row, std::size_t column) const {
    return &bytes_[stretch_.begin + row * stretch_.period + column];
  }
  void find_constants();
  void find_values();
  void find_fields();
  void add_counter(std::size_t column, std::size_t width, bool big_endian, bool real);

  Bytes bytes_;
  ByteStretch stretch_;
  double seconds_;
  std::size_t steps_;                          // from row to row
  std::vector<std::uint32_t> sums_, crossed_;  // of the stretch's bytes before each
  std::vector<double> constant_;
  std::vector<unsigned char> usual_;
  std::vector<Values> values_;
  std::vector<std::vector<FieldFound>> fields_;
};

/// One way to read binary frames, and how few bits describe the bytes when they are read so.
struct BinaryReading {
  FrameFormat format;
  std::size_t values = 0, period = 0;  ///< numbers, and bytes, of a frame
  double bits = 0, sent = 0;           ///< of the description, and of all bytes as they came
  bool unit_assumed = false;           ///< of the clock; a file says nothing of the time it took
  bool unknown = false;                ///< some bytes are no value and have no meaning that is known
  bool foreign_sum = false;            ///< a byte behind the values follows from all others
  bool mixed = false;                  ///< its fields have two byte orders
  bool sign_unsure = false;            ///< signed, though what is below 0 is the same number each time
  std::string text() const;
};
/// Of numbers of two bytes a higher one changes, and no lower one has its highest bit.
bool holds_seven_bits(const BinaryReading& reading, std::span<const Heard> heard);
/// The best reading of all bytes that were heard, where it leads the second by 8 bits (256 to 1), and no
/// reading takes a part of its frames for whole ones; else empty, and `says` names both. `values`: how many a
/// frame has, where that is known.
std::optional<BinaryReading> find_binary_format(Bytes bytes, std::span<const Heard> heard,
                                                std::optional<std::size_t> values,
                                                std::vector<std::string>& says);

}  // namespace supertac
