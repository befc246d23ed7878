#include "data/recordings/imports/imports.h"

#include <array>
#include <string_view>

#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::string_view kSeparators = " \t,\r";

/// Cuts the next column off the line; empty when there is none.
std::string_view next_column(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(kSeparators);
  if (begin == std::string_view::npos) return {};
  line.remove_prefix(begin);
  const std::string_view column = line.substr(0, line.find_first_of(kSeparators));
  line.remove_prefix(column.size());
  return column;
}

bool is_frame(std::string_view line, std::array<float, rig::kTaxels>& volts) {
  for (float& v : volts) {
    const auto value = parse_double(next_column(line));
    if (!value || !(*value >= 0 && *value <= rig::kAdcVolts)) return false;
    v = static_cast<float>(*value);
  }
  return next_column(line).empty();
}

void refuse_other_files(const std::string& path, const ImportReport& report) {
  const std::size_t written = report.lines - report.empty;
  if (written == 0) throw FileError(path, "is empty, expected lines of 16 voltages; record or copy it again");
  if (report.dropped() * 10 <= written) return;
  throw FileError(path, std::to_string(report.dropped()) + " of " + std::to_string(written) +
                            " lines are not 16 voltages from 0 to " + format(rig::kAdcVolts) +
                            ", expected at most a tenth; is it a recording?");
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
    ++report.lines;
    if (line.find_first_not_of(kSeparators) == std::string_view::npos) ++report.empty;
    if (!is_frame(line, volts)) continue;
    ++report.frames;
    recording.time_s.push_back(static_cast<double>(report.lines - report.empty - 1) / rig::kFrameRateHz);
    recording.signals.insert(recording.signals.end(), volts.begin(), volts.end());
  }
  refuse_other_files(path, report);
  return recording;
}

}  // namespace supertac
