// The text of Marlin's serial protocol, without any port: numbered lines with checksums, and what a reply
// means.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "data/sensors/rig.h"

namespace supertac {

double distance(const Point3& a, const Point3& b);
/// a at part 0, b at 1.
Point3 between(const Point3& a, const Point3& b, double part);

/// "X99.70 Y101.17 Z91.81"-style text for messages.
std::string describe(const Point3& point);

constexpr std::size_t kMaxLineBytes = 96;  ///< Marlin's MAX_CMD_SIZE

/// XOR of all bytes.
unsigned marlin_checksum(std::string_view text);

/// "M114" as "M0114", which Marlin runs as the same code: its emergency parser reads every byte ahead of
/// checksums and would obey a damaged line that begins like M112 or M410 ("M1124", one bit of "M400"). Behind
/// the zero no single damaged byte gets there. M110, which Marlin looks for literally, and all other commands
/// stay as they are.
std::string shielded(std::string_view command);

/// `N<n> <command>*<xor>\n`. Throws std::invalid_argument when longer than 96 bytes or when the command holds
/// a line break or '*'.
std::string numbered_line(std::int64_t number, std::string_view command);

enum class ReplyKind {
  ok,
  resend,           ///< Resend: number
  line_fault,       ///< Error:... about checksum or line number; number = Last Line when it could be read
  fatal,            ///< kill(), halt: nothing more may be sent
  error,            ///< any other Error:, and Klipper's !!
  unknown_command,  ///< acknowledged but not run
  busy,             ///< echo:busy: processing
  paused,           ///< echo:busy: paused for user
  interrupted,      ///< //action:cancel or its like, also within a line: stopped at its display, or by itself
  start,            ///< the firmware restarted: a line of its banner
  wait,             ///< heartbeat of an idle firmware
  position,         ///< M114, or M154's report of the queue's end
  temperature,      ///< M155's report
  other
};

struct Reply {
  ReplyKind kind = ReplyKind::other;
  std::optional<std::int64_t> number;
  Point3 position;
  std::string text;
};

/// Classifies one line without its line break. Damaged text becomes `other`, or `error` when it still starts
/// with "Error:".
Reply parse_reply(std::string_view line);

}  // namespace supertac
