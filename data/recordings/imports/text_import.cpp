#include "data/recordings/imports/text_import.h"

#include <array>
#include <cmath>
#include <string_view>

#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::string_view kSeparators = " \t,\r";

/// What a line is: the counter that it belongs to.
using Line = std::size_t ImportReport::*;

/// Cuts the next column off the line; empty when there is none.
std::string_view next_column(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(kSeparators);
  if (begin == std::string_view::npos) return {};
  line.remove_prefix(begin);
  const std::string_view column = line.substr(0, line.find_first_of(kSeparators));
  line.remove_prefix(column.size());
  return column;
}

Line parse_line(std::string_view line, std::array<float, rig::kTaxels>& volts) {
  std::size_t columns = 0;
  bool numeric = true;
  bool finite = true;
  bool in_range = true;
  for (auto column = next_column(line); !column.empty(); column = next_column(line), ++columns) {
    if (columns >= rig::kTaxels) return &ImportReport::too_many;
    const auto value = parse_double(column);
    numeric = numeric && value.has_value();
    if (!value) continue;
    finite = finite && std::isfinite(*value);
    in_range = in_range && *value >= 0 && *value <= rig::kAdcVolts;
    volts[columns] = static_cast<float>(*value);
  }
  if (columns == 0) return &ImportReport::empty;
  if (columns < rig::kTaxels) return &ImportReport::too_few;
  if (!numeric) return &ImportReport::not_numeric;
  if (!finite) return &ImportReport::non_finite;
  return in_range ? &ImportReport::frames : &ImportReport::out_of_range;
}

void refuse_other_files(const std::string& path, const ImportReport& report) {
  const std::size_t written = report.lines - report.empty;
  if (written == 0) throw FileError(path, "is empty, expected lines of 16 voltages; record or copy it again");
  const std::size_t dropped = written - report.frames;
  if (dropped * 10 <= written) return;
  throw FileError(
      path, std::to_string(dropped) + " of " + std::to_string(written) +
                " lines are not 16 voltages from 0 to " + format(rig::kAdcVolts) + " (" +
                std::to_string(report.too_few) + " with fewer columns, " + std::to_string(report.too_many) +
                " with more, " + std::to_string(report.not_numeric) + " not numeric, " +
                std::to_string(report.non_finite) + " not finite, " + std::to_string(report.out_of_range) +
                " out of range), expected at most a tenth; is it a recording?");
}

}  // namespace

Recording import_text_pass(const std::string& path, ImportReport& report) {
  report = {};
  const std::string text = read_text_file(path, 64 << 20);
  Recording recording;
  recording.source = "imported";
  recording.metadata["time_base"] = "nominal";
  recording.metadata["filter_s"] = format(rig::kFilterS);
  std::array<float, rig::kTaxels> volts{};
  for (std::string_view rest = text; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    const Line kind = parse_line(line, volts);
    ++report.lines;
    ++(report.*kind);
    if (kind != &ImportReport::frames) continue;
    recording.time_s.push_back(static_cast<double>(report.lines - report.empty - 1) / rig::kFrameRateHz);
    recording.signals.insert(recording.signals.end(), volts.begin(), volts.end());
  }
  refuse_other_files(path, report);
  return recording;
}

}  // namespace supertac
