#include "hardware/printers/printer.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr bool marlin = false, klipper = true;

struct StateRule {
  const char* state;  // its name, for people
  bool of_klipper;
  const char* set;     // the command that gives the wanted value; empty: only the owner can
  const char* read;    // the one whose answer tells it; empty: none does
  const char* label;   // what stands before the value in that answer
  const char* wanted;  // the value, as it stands before ';', '%' or the line's end
  const char* back;    // the commands that give another value back, '?' for it; empty: stays as set;
                       // nullptr: the first rule's gives it back
  const char* if_not;  // what the owner does where it stays another; empty: the run does not depend on it
  bool homed = false;  // matters for a homed machine only: a confirmed origin is in the coordinates of now
};

constexpr double kGivenBackWithin = 0.5;  // s: nothing moves when a state is given back
constexpr const char* kByHand = "set it by hand and start again";

// Old and new Marlin by their answers: an old one says nothing where a new one reports, and is set all the
// same. What else Marlin keeps between jobs moves no head that is sent absolute targets.
constexpr StateRule kRules[] = {
    {"speed, flow and coordinates", klipper, "SAVE_GCODE_STATE NAME=supertac", "", "", "",
     "RESTORE_GCODE_STATE NAME=supertac", ""},
    {"unit of lengths", marlin, "G21", "M503", "  G2", "1", "G20", kByHand},
    {"unit of lengths", klipper, "G21", "", "", "", nullptr, ""},
    {"absolute positions", marlin, "G90", "", "", "", "", ""},
    {"absolute positions", klipper, "G90", "", "", "", nullptr, ""},
    {"plane", marlin, "G17", "", "", "", "", ""},
    {"workspace", marlin, "G53", "", "", "", "", ""},
    {"speed factor", marlin, "M220 S100", "M220", "FR:", "100", "M220 S?", kByHand},
    {"speed factor", klipper, "M220 S100", "", "", "", nullptr, ""},
    {"flow factor", marlin, "M221 S100", "M221", "Flow: ", "100", "M221 S?", ""},
    {"flow factor", klipper, "M221 S100", "", "", "", nullptr, ""},
    {"reports of position", marlin, "M154 S0", "", "", "", "", ""},
    {"reports of temperature", marlin, "M155 S0", "", "", "", "", ""},
    {"mesh compensation", marlin, "M420 S0", "M420", "Bed Leveling ", "OFF", "M420 S1", kByHand},
    {"mesh compensation", klipper, "BED_MESH_CLEAR", "BED_MESH_PROFILE SAVE=supertac", "profile [supertac]",
     ", the bed has not been probed", "BED_MESH_PROFILE LOAD=supertac;BED_MESH_PROFILE REMOVE=supertac", ""},
    {"offset of the coordinates", klipper, "SET_GCODE_OFFSET X=0 Y=0 Z=0", "GET_POSITION",
     "gcode homing: ", "X:0.000000 Y:0.000000 Z:0.000000", nullptr, kByHand},
    {"home offset (M206)", marlin, "", "M503", "M206 X", "0.00 Y0.00 Z0.00", "",
     "set it to 0 (M206 X0 Y0 Z0), or confirm the origin instead of homing", true},
};

/// Nothing where the firmware does not know the command.
std::optional<MarlinLink::Answer> run(MarlinLink& link, const std::string& command, double deadline_s = 0) {
  try {
    return link.command(command, deadline_s);
  } catch (const PrinterRefused&) {
    return std::nullopt;
  }
}

/// Whether the firmware took it. Klipper is silent then: what it refuses may have been damaged on its way,
/// and what it says may be a damaged complaint.
bool set_by(MarlinLink& link, const std::string& command, double deadline_s = 0) {
  std::optional<MarlinLink::Answer> answer = run(link, command, deadline_s);
  for (int i = 1; i < kAttempts && link.capabilities().klipper && !(answer && answer->replies.empty()); ++i)
    answer = run(link, command, deadline_s);
  return answer.has_value();
}

bool is_wanted(const std::string& value, const StateRule& rule) {
  return std::ranges::equal(value, std::string_view(rule.wanted), {}, lower, lower);
}

/// The value as three answers in a row have it: a damaged one must be neither believed nor given back.
std::optional<std::string> value_by(MarlinLink& link, const StateRule& rule) {
  const std::string_view label = rule.label;
  const auto value = [&]() -> std::optional<std::string> {
    for (const Reply& reply : run(link, rule.read).value_or(MarlinLink::Answer()).replies) {
      const std::size_t at = reply.text.find(label);
      if (at == std::string::npos) continue;
      const std::string_view rest = std::string_view(reply.text).substr(at + label.size());
      return std::string(trimmed(rest.substr(0, rest.find_first_of(";%"))));
    }
    return std::nullopt;
  };
  std::optional<std::string> before = value();
  for (int i = 0, same = 1; i < kAttempts && same < 3; ++i)
    same = std::exchange(before, value()) == before ? same + 1 : 1;
  return before;
}

}  // namespace

void MachineState::set(MarlinLink& link, bool homed) {
  for (const StateRule& rule : kRules) {
    if (rule.of_klipper != link.capabilities().klipper || (rule.homed && !homed)) continue;
    const std::string set = rule.set, read = rule.read, wanted = rule.wanted;
    const std::string name = rule.state + (" (" + set + ")");
    const auto known = std::ranges::find(changed_, name, &Changed::name);
    std::string back = rule.back == nullptr ? "" : rule.back;
    if (known != changed_.end() && read.empty() && !back.empty()) continue;  // saved once
    std::optional<std::string> found;
    if (!read.empty()) found = value_by(link, rule);
    const bool another = found && !is_wanted(*found, rule);
    const bool taken = !set.empty() && set_by(link, set);
    const bool gone = taken && rule.back != nullptr && (!found || another);
    if (const std::size_t at = back.find('?'); at != back.npos) back.replace(at, 1, found.value_or(""));
    if (gone && known == changed_.end()) changed_.push_back({name, found || read.empty() ? back : ""});
    if (!another || *rule.if_not == 0) continue;
    if (!set.empty()) found = value_by(link, rule);
    if (!found || is_wanted(*found, rule)) continue;
    throw PrinterRefused("printer " + link.port().name() + ": expected its " + rule.state + " at " +
                         in_quotes(trimmed(rule.label + wanted)) + ", found " +
                         in_quotes(trimmed(rule.label + *found)) + (set.empty() ? "" : " after " + set) +
                         "; " + rule.if_not);
  }
}

void MachineState::put_back(MarlinLink& link) {
  for (std::size_t i = changed_.size(); i-- > 0;) {
    if (changed_[i].back.empty()) continue;
    bool taken = true;
    for (const std::string_view command : split_line(changed_[i].back, ';'))
      taken = taken && set_by(link, std::string(command), kGivenBackWithin);
    if (taken) changed_.erase(changed_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

std::string MachineState::kept() const { return joined(changed_, ", ", &Changed::name); }

std::optional<SoftLimits> soft_limits_of(MarlinLink& link) {
  if (link.capabilities().klipper) return std::nullopt;
  for (const Reply& reply : run(link, "M211").value_or(MarlinLink::Answer()).replies) {
    std::string text = reply.text;
    std::ranges::transform(text, text.begin(), lower);
    SoftLimits soft{{}, {}, reply.text};
    Point3 &low = soft.low, &high = soft.high;
    const std::size_t at = text.find("soft endstops: on");
    if (at != std::string::npos &&
        std::sscanf(text.c_str() + at, "soft endstops: on min: x%lf y%lf z%lf max: x%lf y%lf z%lf", &low.x,
                    &low.y, &low.z, &high.x, &high.y, &high.z) == 6)
      return soft;
  }
  return std::nullopt;
}

}  // namespace supertac
