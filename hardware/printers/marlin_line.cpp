// The text of Marlin's serial protocol, without any port.

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <stdexcept>

#include "hardware/printers/marlin_link.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

bool contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

bool contains_one(std::string_view text, std::initializer_list<std::string_view> parts) {
  return std::ranges::any_of(parts, [text](std::string_view part) { return contains(text, part); });
}

std::optional<std::int64_t> number_after(std::string_view text, std::string_view label) {
  const std::size_t at = text.find(label);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view rest = trimmed(text.substr(at + label.size()));
  return parse_int(rest.substr(0, rest.find(' ')));
}

// "X:99.70 Y:101.17 Z:91.81 E:0.00 Count ...": all three, or the line counts as damaged.
std::optional<Point3> position_in(std::string_view text) {
  const std::vector<std::string_view> words = split_line(text, ' ');
  std::array<double, 3> values{};
  for (std::size_t axis = 0; axis < values.size(); ++axis) {
    constexpr std::string_view kLabels[] = {"X:", "Y:", "Z:"};
    if (axis >= words.size() || !words[axis].starts_with(kLabels[axis])) return std::nullopt;
    const std::string_view number = words[axis].substr(kLabels[axis].size());
    const std::optional<double> value = parse_double(number);
    // Two decimals at least: a lost point or digit would otherwise move the head by metres.
    const std::size_t point = number.find('.');
    if (!value || point == std::string_view::npos || number.size() - point < 3 ||
        number.find_first_of("eE") != std::string_view::npos)
      return std::nullopt;
    values[axis] = *value;
  }
  return Point3{values[0], values[1], values[2]};
}

// What a firmware says when it runs nothing any more. A heater's error alone is none of these: the machine
// may go on, and where it does not, it says so.
bool is_fatal(std::string_view text) {
  return contains_one(text, {"kill() called", "Printer halted", "system stopped", "Printer stopped",
                             "Printer is shutdown", "Shutdown due to"});
}

bool is_of_a_heater(std::string_view text) {
  return contains_one(
      text, {"Heater", "Heating failed", "MAXTEMP", "MINTEMP", "Thermal", "THERMAL", "temperature"});
}

// "//action:cancel", which some firmwares write with blanks and some as "print_abort": that the printer was
// stopped or paused. It is said unasked, so it may begin in the middle of another line.
bool is_interruption(std::string_view line) {
  constexpr std::string_view kAction = "action:";
  const std::size_t at = line.find(kAction);
  if (at == std::string_view::npos || !trimmed(line.substr(0, at)).ends_with("//")) return false;
  line.remove_prefix(std::min(line.size(), line.find_first_not_of(' ', at + kAction.size())));
  return contains_one(line.substr(0, line.find(' ')),
                      {"cancel", "pause", "stop", "abort", "kill", "out_of_filament", "runout", "poweroff",
                       "disconnect", "shutdown"});
}

// Of a boot banner: any of its lines that no firmware in use says, for "start" itself may be lost.
bool is_banner(std::string_view line) {
  constexpr std::string_view kLines[] = {
      "start",          "PowerUp",        "External Reset",          "Brown out Reset",
      "Watchdog Reset", "Software Reset", "// Klipper state: Ready", "// Klipper state: Disconnect"};
  return std::ranges::count(kLines, line) > 0 || line.starts_with("Marlin ") ||
         line.starts_with("echo:Marlin ");
}

Reply error_reply(std::string_view text) {
  if (is_of_a_heater(text)) return {ReplyKind::other, {}, {}, std::string(text)};
  const bool line_fault = contains_one(text, {"checksum", "Checksum", "Line Number", "Last Line"});
  return {line_fault ? ReplyKind::line_fault : ReplyKind::error,
          number_after(text, "Last Line:"),
          {},
          std::string(text)};
}

}  // namespace

double distance(const Point3& a, const Point3& b) { return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z); }

Point3 between(const Point3& a, const Point3& b, double part) {
  return {a.x + part * (b.x - a.x), a.y + part * (b.y - a.y), a.z + part * (b.z - a.z)};
}

std::string describe(const Point3& point) {
  return "X" + format(point.x, 2) + " Y" + format(point.y, 2) + " Z" + format(point.z, 2);
}

unsigned marlin_checksum(std::string_view text) {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  return sum;
}

std::string shielded(std::string_view command) {
  if (!command.starts_with('M') || command.starts_with("M110")) return std::string(command);
  return "M0" + std::string(command.substr(1));
}

std::string numbered_line(std::int64_t number, std::string_view command) {
  if (command.find_first_of("\r\n*") != std::string_view::npos)
    throw std::invalid_argument(
        refusal("marlin line", "command", "neither a line break nor '*'", in_quotes(command)));
  std::string line = "N" + std::to_string(number) + " " + std::string(command);
  line += "*" + std::to_string(marlin_checksum(line)) + "\n";
  if (line.size() > kMaxLineBytes)
    throw std::invalid_argument(refusal("marlin line", "command",
                                        "a line of at most " + std::to_string(kMaxLineBytes) + " bytes",
                                        std::to_string(line.size()) + " for " + in_quotes(command)));
  return line;
}

Reply parse_reply(std::string_view line) {
  const auto kind = [line](ReplyKind k, std::optional<std::int64_t> number = {}) {
    return Reply{k, number, {}, std::string(line)};
  };
  if (is_interruption(line)) return kind(ReplyKind::interrupted);
  if (is_fatal(line)) return kind(ReplyKind::fatal);
  if (line == "ok" || line.starts_with("ok ")) return kind(ReplyKind::ok);
  if (is_banner(line)) return kind(ReplyKind::start);
  if (line == "wait") return kind(ReplyKind::wait);
  if (line.starts_with("Resend:")) return kind(ReplyKind::resend, number_after(line, "Resend:"));
  if (line.starts_with("rs ")) return kind(ReplyKind::resend, number_after(line, "rs "));
  if (line.starts_with("Error:")) return error_reply(line);
  if (contains(line, "echo:busy: paused")) return kind(ReplyKind::paused);
  if (line.starts_with("echo:busy:")) return kind(ReplyKind::busy);
  if (line.starts_with("echo:Unknown command") || line.starts_with("// Unknown command"))
    return kind(ReplyKind::unknown_command);
  if (line.starts_with("!! ")) return kind(ReplyKind::error);
  if (const auto position = position_in(line)) {
    return {ReplyKind::position, {}, *position, std::string(line)};
  }
  const std::size_t text = line.find_first_not_of(' ');
  for (const std::string_view heater : {"T:", "T0:", "B:"})
    if (text != std::string_view::npos && line.substr(text).starts_with(heater))
      return kind(ReplyKind::temperature);
  return kind(ReplyKind::other);
}

}  // namespace supertac
