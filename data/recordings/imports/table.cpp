#include "data/recordings/imports/imports.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string_view>

#include "data/frames/probe.h"
#include "data/frames/text_grammar.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr std::uint64_t kMaxBytes = std::uint64_t{4} << 30;

// --- NumPy's files: "\x93NUMPY", version, length of the header, a Python dictionary, the values.

template <class T>
void convert(std::span<const std::byte> bytes, std::vector<double>& to) {
  for (std::size_t i = 0; i + sizeof(T) <= bytes.size(); i += sizeof(T)) {
    T value;
    std::memcpy(&value, bytes.data() + i, sizeof(T));
    to.push_back(static_cast<double>(value));
  }
}

struct NumberType {
  std::size_t bytes;
  void (*convert)(std::span<const std::byte> from, std::vector<double>& to);
};
const std::map<std::string_view, NumberType> kNumberTypes = {
    {"<f4", {4, convert<float>}},         {"<f8", {8, convert<double>}},
    {"|u1", {1, convert<std::uint8_t>}},  {"|i1", {1, convert<std::int8_t>}},
    {"<u2", {2, convert<std::uint16_t>}}, {"<i2", {2, convert<std::int16_t>}},
    {"<u4", {4, convert<std::uint32_t>}}, {"<i4", {4, convert<std::int32_t>}},
    {"<u8", {8, convert<std::uint64_t>}}, {"<i8", {8, convert<std::int64_t>}}};

/// What stands behind 'key': in the header, up to `end`.
std::string_view entry(std::string_view header, const std::string& key, std::string_view begin, char end) {
  std::size_t at = header.find("'" + key + "':");
  if (at == std::string_view::npos) return {};
  at = header.find(begin, at + key.size() + 3);
  if (at == std::string_view::npos) return {};
  header.remove_prefix(at + begin.size());
  return header.substr(0, header.find(end));
}

Table numpy_table(const std::string& path, FileReader& file) {
  const auto refuse = [&](const std::string& problem) { throw FileError(path, problem); };
  std::array<unsigned char, 12> start{};
  file.read(std::as_writable_bytes(std::span(start).first(std::min<std::uint64_t>(12, file.size()))));
  if (std::memcmp(start.data(), "\x93NUMPY", 6) != 0 || start[6] < 1 || start[6] > 3)
    refuse("expected a file of numpy.save, found other bytes");
  std::size_t length = start[8] + 256U * start[9], prefix = 10;
  if (start[6] > 1) length += 65536U * start[10] + (std::size_t{start[11]} << 24), prefix = 12;
  if (length > 65536 || length + prefix > file.size() || length < 2) refuse("its header is cut or too long");
  // Of version 1 two bytes of the header have been read.
  std::string header(reinterpret_cast<const char*>(start.data()) + prefix, 12 - prefix);
  header.resize(length);
  file.read(std::as_writable_bytes(std::span(header).subspan(12 - prefix)));

  const std::string_view type = entry(header, "descr", "'", '\'');
  const auto number = kNumberTypes.find(type);
  if (number == kNumberTypes.end())
    refuse("holds numbers of type " + in_quotes(type) +
           ", expected one of f4, f8, i1 to i8, u1 to u8, little endian: save array.astype('f4')");
  if (header.find("'fortran_order': True") != std::string::npos)
    refuse("is in Fortran's order: save numpy.ascontiguousarray(array)");
  std::vector<std::size_t> shape;
  std::size_t numbers = 1;
  for (const std::string& part : comma_list(std::string(entry(header, "shape", "(", ')')))) {
    std::string_view dim = trimmed(part);
    if (dim.size() > 1 && dim.ends_with('L')) dim.remove_suffix(1);  // Python 2's long
    if (dim.empty()) continue;
    const auto value = parse_uint(dim);
    if (!value || *value < 1 || *value > kMaxBytes)
      refuse("has a side of " + in_quotes(dim) + ", expected 1 or more");
    if (*value > kMaxBytes / sizeof(double) / numbers)
      refuse("holds more than " + std::to_string(kMaxBytes / sizeof(double)) +
             " numbers; cut it into several");
    shape.push_back(*value), numbers *= *value;
  }
  if (shape.size() < 1 || shape.size() > 4)
    refuse("is of rank " + std::to_string(shape.size()) + ", expected 1 to 4: rows first");
  const std::uint64_t left = file.size() - prefix - length;
  if (left != numbers * number->second.bytes)
    refuse("holds " + std::to_string(left) + " bytes of values, its shape needs " +
           std::to_string(numbers * number->second.bytes) + "; it is cut or damaged");
  Table table;
  table.shape.assign(shape.begin() + 1, shape.end());
  table.columns = numbers / shape[0];
  const std::size_t row_bytes = table.columns * number->second.bytes;
  table.values.reserve(numbers);
  const std::size_t rows_at_once = std::max<std::size_t>(1, (std::size_t{1} << 20) / row_bytes);
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < shape[0]; i += rows_at_once) {
    rows.resize(std::min(rows_at_once, shape[0] - i) * row_bytes);
    file.read(rows);
    number->second.convert(rows, table.values);
  }
  return table;
}

// --- text

/// Empty lines and remarks hold none.
bool holds_row(std::string_view line) {
  const std::string_view content = trimmed(line);
  return !content.empty() && content.front() != '#';
}

/// What a file without a table is, as the end of a sentence; empty where that is text, or unknown, and no
/// `lines` are given, which have no grammar.
std::string other_than_table(const std::string& whole, const std::vector<std::string>& lines) {
  const Heard heard{0, whole.substr(0, 1 << 16)};
  const ProbeReport report = probe({&heard, 1}, "-", {});
  const FrameKind kind = report.draft ? report.draft->frame.kind : FrameKind::text;
  if (kind != FrameKind::text)
    return std::string("holds no table but ") +
           (kind == FrameKind::json    ? "objects of JSON"
            : kind == FrameKind::board ? "frames of the rig's board"
                                       : "binary frames") +
           "; supertac-stream --sensor FILE --record DIR reads them, where \"port\" of the sensor's file is "
           "this one";
  if (lines.empty()) return whole.empty() ? "is empty, expected a row a line" : "";
  const auto numbers = std::ranges::count_if(lines, [](const std::string& line) {
    return holds_row(line) && line.find_first_not_of("0123456789+-.,;eE \t\r") == std::string::npos;
  });
  const auto guess = std::ranges::find_if(
      report.says, [](const std::string& line) { return line.starts_with("it may be: "); });
  const std::string& why = guess != report.says.end() ? *guess : report.says.back();
  return (2 * numbers > std::ssize(lines) ? "holds lines of numbers, but no form that half of them have"
                                          : "holds no line of numbers") +
         (report.draft ? "" : " (" + why.substr(0, why.find(';')) + ")") +
         "; expected a row a line, separated by commas, tabs or blanks";
}

Table text_table(const std::string& path, std::uint64_t most) {
  const std::string whole = read_text_file(path, most);
  std::string_view text = whole;
  const auto next = [&] {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    return line;
  };
  std::vector<std::string> learnt;
  while (!text.empty() && learnt.size() < 2000) learnt.emplace_back(next());
  const std::optional<TextGrammar> grammar = find_grammar(learnt);
  if (!grammar) throw FileError(path, other_than_table(whole, learnt));
  if (!grammar->doubt.empty()) throw FileError(path, "two readings explain it alike: " + grammar->doubt);
  Table table;
  table.columns = grammar->slots.size(), table.shape = {table.columns};
  const FrameFormat& format = grammar->format;
  TextFrames frames(format);
  std::size_t number = 0, lines = 0;
  for (text = whole; !text.empty();) {
    const std::string line = clean_line(next());
    ++number;
    if (line.starts_with('#')) continue;
    const auto result = frames.push(line);
    if (line.empty() && result == TextFrames::Result::nothing) continue;
    ++lines;
    const auto& slots = frames.slots();
    bool fits = result == TextFrames::Result::frame && slots.size() == table.columns;
    for (std::size_t c = 0; fits && c < slots.size(); ++c) fits = slots[c].words == grammar->slots[c].words;
    if (fits) {
      for (const TextSlot& slot : slots) table.values.push_back(slot.value);
      table.lines.push_back(number), table.places.push_back(lines);
    } else if (result == TextFrames::Result::nothing) {
      --lines;  // of a frame of several
    } else if (table.rows() == 0 && table.names.empty() && format.lines_per_frame == 1) {
      const auto names = slots_of(line, format.separator == 0 ? ',' : format.separator, format.decimal);
      if (names.size() == table.columns && std::ranges::all_of(names, &TextSlot::words))
        for (const TextSlot& name : names) table.names.emplace_back(name.text);
      else
        ++table.dropped;
    } else {
      ++table.dropped;
    }
  }
  if (table.dropped * 10 > table.rows() + table.dropped) {
    // A line's end among other bytes makes no text of them.
    const auto control = [](char c) {
      return c > 0 && c < ' ' && std::string_view("\t\n\r\x1B").find(c) == std::string_view::npos;
    };
    const bool binary = 50 * std::ranges::count_if(whole, control) > std::ssize(whole);
    if (const std::string other = binary ? other_than_table(whole, {}) : ""; !other.empty())
      throw FileError(path, other);
    throw FileError(path, std::to_string(table.dropped) + " of " + std::to_string(lines) + " lines are not " +
                              std::to_string(table.columns) +
                              " numbers, expected at most a tenth; is it a table of numbers?");
  }
  return table;
}

}  // namespace

std::size_t Table::column(const std::string& name) const {
  if (const auto found = std::ranges::find(names, name); found != names.end())
    return static_cast<std::size_t>(found - names.begin());
  if (const auto number = parse_uint(name); number && *number < columns) return *number;
  std::string known = names.empty() ? "no names" : "the names";
  for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 12); ++i)
    known += (i == 0 ? " " : ", ") + printable(names[i]);
  if (names.size() > 12) known += ", ...";
  throw std::invalid_argument("there is no column " + in_quotes(name) + ": the file has columns 0 to " +
                              std::to_string(columns - 1) + " and " + known);
}

Table read_table(const std::string& path) {
  if (!path.ends_with(".npy")) return text_table(path, kMaxBytes);
  FileReader file(path);
  if (file.size() > kMaxBytes) throw FileError(path, "is larger than 4 GiB; cut it into several");
  return numpy_table(path, file);
}

Recording import_text_pass(const std::string& path, std::size_t& dropped) {
  constexpr std::uint64_t kMost = 64 << 20;  // hours of the rig
  const Table table = text_table(path, kMost);
  Recording recording;
  recording.source = "imported";
  recording.metadata = {{"time_base", "nominal"}, {"filter_s", format(rig::kFilterS)}};
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto volts = table.row(i);
    if (volts.size() != rig::kTaxels ||
        !std::ranges::all_of(volts, [](double v) { return v >= 0 && v <= rig::kAdcVolts; }))
      continue;
    recording.time_s.push_back(static_cast<double>(table.places[i] - 1) / rig::kFrameRateHz);
    for (const double v : volts) recording.signals.push_back(static_cast<float>(v));
  }
  const std::size_t lines = table.rows() + table.dropped;
  dropped = lines - recording.frames();
  if (dropped * 10 <= lines) return recording;
  throw FileError(path, std::to_string(dropped) + " of " + std::to_string(lines) +
                            " lines are not 16 voltages from 0 to " + format(rig::kAdcVolts) +
                            ", expected at most a tenth; is it a recording?");
}

}  // namespace supertac
