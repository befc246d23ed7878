// A line of text is a template and slots: what is no number, and the numbers.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

/// A number in a line, or with a separator a cell. NaN where it stands for "no value" (nan, null, -,
/// nothing).
struct TextSlot {
  double value = 0;
  std::string_view text;    ///< as written
  std::string_view before;  ///< the template from the slot before to this one
  bool words = false;       ///< a cell that is no number
  bool wall = false;        ///< HH:MM:SS of a day, or with a date seconds since 1970
};

/// Without NUL bytes (so UTF-16 of ASCII is read), the marks of Unicode, ANSI sequences, and blanks at either
/// end.
std::string clean_line(std::string_view line);

/// The slots of a clean line. With a separator the cells between them (quotes taken away); with separator 0
/// every number: sign, exponent, 0x, units behind it, labels and brackets around it. `decimal`: '.' or ','.
std::vector<TextSlot> slots_of(std::string_view line, char separator, char decimal);

/// The line behind a wall time in front, and the "->" of a serial monitor.
std::string_view behind_stamp(std::string_view line);

/// xor or sum of the characters of `line` before its last '*' or separator, without a '$' in front, is the
/// hexadecimal number behind it.
struct TextChecksum {
  std::string_view line;  ///< without it
  unsigned stated = 0, digits = 0;
  unsigned computed(const std::string& kind) const;
};
std::optional<TextChecksum> checksum_of(std::string_view line);

/// A line, where nine in ten are hexadecimal numbers of one width without a mark, and some have letters.
/// Empty else.
std::string bare_hexadecimal(const std::vector<std::string>& lines);

/// Frames of one or several lines, line by line.
class TextFrames {
 public:
  enum class Result { nothing, frame, torn };
  explicit TextFrames(const FrameFormat& format) : format_(format) {}
  /// What `line` completed; slots() are then its numbers. `torn`: lines that are no frame.
  Result push(std::string_view line);
  const std::vector<TextSlot>& slots() const { return slots_; }

 private:
  FrameFormat format_;
  std::vector<std::string> lines_;
  std::vector<TextSlot> slots_;
  bool open_ = false;
};

/// What a slot of the frames is, and why.
struct SlotRole {
  enum Kind { signal, clock, counter, checksum, constant, label, words, other } kind = signal;
  std::string why = {};
  double unit_s = 0;  ///< of a clock; 0: not known
};

/// What was found in lines, of which the first and the last may be torn.
struct TextGrammar {
  FrameFormat format;                        ///< of kind text, without time and skip
  std::vector<std::vector<double>> columns;  ///< [slot][frame]
  std::vector<std::string> before, sample;   ///< of each slot: template before it, how it is written
  std::vector<int> decimals;                 ///< behind the point, at most; of each slot
  std::vector<bool> words, wall;             ///< of each slot
  std::vector<std::string> says;
  std::string doubt;  ///< two readings that explain the same; empty where there is one
};
/// Reading, period and slots; empty where no reading explains half of the lines.
std::optional<TextGrammar> find_grammar(const std::vector<std::string>& lines);

/// The roles of all slots. `seconds`: for how long the lines came; less than kAtOnceS: all at once, as from a
/// file. Clocks rise at a steady rate, also modulo 2^16 and 2^32; counters rise by one, also modulo; a
/// checksum is the sum or xor of the numbers before it; a constant at an edge is no taxel when the rest makes
/// a better array; the others are signals. A doubt is added to `grammar`.
std::vector<SlotRole> roles_of(TextGrammar& grammar, double seconds);

}  // namespace supertac
