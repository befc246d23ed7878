// A line of text is a template and slots: what is no number, and the numbers.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
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
  std::string_view unit;    ///< letters right behind it, or ")" where it stands between brackets of its own
  std::size_t line = 0;     ///< of its frame
  bool words = false;       ///< a cell that is no number
  bool wall = false;        ///< HH:MM:SS of a day, or with a date seconds since 1970
};

/// Without NUL bytes (so UTF-16 of ASCII is read), the marks of Unicode, ANSI sequences, and blanks at either
/// end.
std::string clean_line(std::string_view line);

/// The slots of a clean line. With a separator the cells between them (quotes taken away); with separator 0
/// every number: sign, exponent (of Fortran too), 0x, thousands parted by "'", units behind it, labels and
/// brackets around it. `decimal`: '.' or ','.
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

enum class Commas { lists, points, doubt, thousands };

/// Whether marks (',' or '.') glued between digits are decimal points, "1,5 2,75", or part the numbers of a
/// list, "1,5,2,75". It is told from what stands behind the mark at one place of many lines:
///   "1,5,2,75"              a list: "," also parts what would be the numbers 1.5 and 2.75
///   "3,07" "3,98" "3,40"    points: all have two digits, and some begin with 0, as no number of a list does
///   "3,17" "3,98" "3,40"    a list: all have two digits, of which the first is never 0, but any other
///   "3,0" "3,1" ... "3,9"   points: all have one digit, and all ten come
///   "3,5" "3,25" "3,125"    points: of several widths none ends in 0, as some numbers of a list do
///   "1,250" beside "980"    thousands: three digits behind a mark, or no mark
/// What fits neither points nor lists, or both, is a doubt.
Commas commas_of(const std::vector<std::string>& lines, char mark);

/// Whether blanks within the cells of a list part thousands.
bool blank_thousands(const std::vector<std::string>& lines);

/// A line with hexadecimal numbers without a mark: at a place of it numbers of one width have letters at
/// times, and at times have none. Empty where there are none; `unsure`: nor are there letters, but all
/// numbers have one width, and fewer than ten digits end them.
std::string bare_hexadecimal(const std::vector<std::string>& lines, bool& unsure);

/// Frames of one or several lines, line by line.
class TextFrames {
 public:
  enum class Result { nothing, frame, torn };
  explicit TextFrames(const FrameFormat& format) : format_(format) {}
  /// What a clean line completed; slots() are then its numbers. `torn`: lines that are no frame.
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

/// A slot in all frames.
struct FoundSlot {
  std::vector<double> column;        ///< what stands there in each frame
  std::string before, sample, name;  ///< template before it, how it is written; from a line of words
  std::size_t line = 0;              ///< of its frame
  int decimals = 0;                  ///< behind the point, at most
  bool words = false, wall = false;  ///< as of TextSlot
  SlotRole role;
};

/// What was found in lines, of which the first and the last may be torn.
struct TextGrammar {
  FrameFormat format;  ///< without time and skip
  std::vector<FoundSlot> slots;
  int channels = 1;  ///< that names tell apart, of each taxel in turn
  std::vector<std::string> says;
  std::string doubt;  ///< two readings that explain the same; empty where there is one
};
/// Reading, period and slots; empty where no reading explains half of the lines.
std::optional<TextGrammar> find_grammar(const std::vector<std::string>& lines);

/// Finds the roles of all slots. `seconds`: for how long the lines came; less than kAtOnceS: all at once, as
/// from a file. Clocks rise at a steady rate, also modulo 2^16 and 2^32; counters rise by one, also modulo; a
/// checksum is the sum or xor of the numbers before it; a constant at an edge is no taxel when the rest makes
/// a better array; the others are signals. A doubt is added to `grammar`.
void find_roles(TextGrammar& grammar, double seconds);

/// The unit (s) of a column of stamps, from how far it went in `seconds`: 1, 1e-3, 1e-6 or 1e-9; empty when
/// it is no clock. For bytes that came at once, as from a file: the unit in which the mean step is a
/// sensor's; empty where two are as likely, where stamps fall, or count by one.
std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds);

/// A format that may be it, and the array that its frames are.
struct FoundFormat {
  FrameFormat format;
  TaxelArray array;
  std::string remark;          ///< for people
  std::vector<int> dead = {};  ///< values that say "nan", "-" or nothing only
};
/// Columns of numbers or objects of JSON in `bytes`, which were heard for `seconds`; empty, and `says` why,
/// where they are neither.
std::optional<FoundFormat> find_text_format(const std::string& bytes, double seconds,
                                            std::vector<std::string>& says);
/// Of so many values the most nearly square array, or the one that nested lists of JSON show (`nested`: the
/// length of each, from outside), with three channels where they are threes; empty when no array has so many.
std::optional<TaxelArray> assumed_array(std::size_t values, std::span<const std::size_t> nested = {});

}  // namespace supertac
