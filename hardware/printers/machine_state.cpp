#include "hardware/printers/machine_state.h"

#include <algorithm>
#include <map>
#include <optional>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

enum Dialect : unsigned { kMarlin = 1, kKlipper = 2, kReprap = 4 };

struct StateRule {
  const char* state;  // its name, for people
  unsigned dialects;
  const char* set;     // the command that gives the wanted value; empty: only the owner can
  const char* read;    // the one whose answer tells it; empty: none does
  const char* label;   // what stands before the value in that answer
  const char* wanted;  // the value, as it stands before ';', '%' or the line's end
  const char* back;    // the commands that give another value back, '?' for it; empty: stays as set;
                       // nullptr: the first rule's gives it back
  const char* if_not;  // what the owner does where it stays another; empty: the run does not depend on it
  bool homed = false;  // matters for a homed machine only: a confirmed origin is in the coordinates of now
};

constexpr const char* kByHand = "set it by hand and start again";

// Old and new Marlin by their answers: an old one says nothing where a new one reports, and is set all the
// same. What else Marlin keeps between jobs moves no head that is sent absolute targets.
constexpr StateRule kRules[] = {
    {"state of another job", kKlipper, "SAVE_GCODE_STATE NAME=supertac", "", "", "",
     "RESTORE_GCODE_STATE NAME=supertac", ""},
    {"state of another job", kReprap, "M120", "", "", "", "M121", ""},
    {"unit of lengths", kMarlin, "G21", "M503", "  G2", "1", "G20", kByHand},
    {"unit of lengths", kKlipper | kReprap, "G21", "", "", "", nullptr, ""},
    {"absolute positions", kMarlin, "G90", "", "", "", "", ""},
    {"absolute positions", kKlipper | kReprap, "G90", "", "", "", nullptr, ""},
    {"feed rate a minute", kReprap, "G94", "", "", "", nullptr, ""},
    {"plane", kMarlin, "G17", "", "", "", "", ""},
    {"plane", kReprap, "G17", "", "", "", nullptr, ""},
    {"workspace", kMarlin, "G53", "", "", "", "", ""},
    {"workspace", kReprap, "G54", "", "", "", "", ""},
    {"speed factor", kMarlin, "M220 S100", "M220", "FR:", "100", "M220 S?", kByHand},
    {"speed factor", kReprap, "M220 S100", "M220", "override: ", "100.0", "M220 S?", kByHand},
    {"speed factor", kKlipper, "M220 S100", "", "", "", nullptr, ""},
    {"flow factor", kMarlin, "M221 S100", "M221", "Flow: ", "100", "M221 S?", ""},
    {"flow factor", kKlipper, "M221 S100", "", "", "", nullptr, ""},
    {"flow factor", kReprap, "M221 S100", "", "", "", "", ""},
    {"reports of position", kMarlin, "M154 S0", "", "", "", "", ""},
    {"reports of temperature", kMarlin, "M155 S0", "", "", "", "", ""},
    {"mesh compensation", kMarlin, "M420 S0", "M420", "Bed Leveling ", "OFF", "M420 S1", kByHand},
    {"mesh compensation", kKlipper, "BED_MESH_CLEAR", "BED_MESH_PROFILE SAVE=supertac", "profile [supertac]",
     ", the bed has not been probed", "BED_MESH_PROFILE LOAD=supertac;BED_MESH_PROFILE REMOVE=supertac", ""},
    {"mesh compensation", kReprap, "G29 S2", "M409 K\"move.compensation.type\"", "\"result\":", "\"none\"}",
     "G29 S1", kByHand},
    {"offset of the coordinates", kKlipper, "SET_GCODE_OFFSET X=0 Y=0 Z=0", "GET_POSITION",
     "gcode homing: ", "X:0.000000 Y:0.000000 Z:0.000000", "", kByHand},
    {"home offset (M206)", kMarlin, "", "M503", "M206 X", "0.00 Y0.00 Z0.00", "",
     "set it to 0 (M206 X0 Y0 Z0), or confirm the origin instead of homing", true},
};

unsigned dialect_of(const MarlinCapabilities& firmware) {
  return firmware.klipper ? kKlipper : firmware.reprap ? kReprap : kMarlin;
}

/// Nothing where the firmware does not know the command.
std::optional<MarlinLink::Answer> run(MarlinLink& link, const std::string& command) {
  try {
    return link.command(command);
  } catch (const PrinterRefused&) {
    return std::nullopt;
  }
}

/// Whether the firmware took it. Klipper is silent then: what it says may be a damaged complaint.
bool set_by(MarlinLink& link, const std::string& command) {
  constexpr int kAttempts = 3;
  std::optional<MarlinLink::Answer> answer = run(link, command);
  for (int i = 1; i < kAttempts && link.capabilities().klipper && answer && !answer->replies.empty(); ++i)
    answer = run(link, command);
  return answer.has_value();
}

std::optional<std::string> value_in(const MarlinLink::Answer& answer, std::string_view label) {
  for (const Reply& reply : answer.replies) {
    const std::size_t at = reply.text.find(label);
    if (at == std::string::npos) continue;
    const std::string_view rest = std::string_view(reply.text).substr(at + label.size());
    return std::string(trimmed(rest.substr(0, rest.find_first_of(";%"))));
  }
  return std::nullopt;
}

bool is_wanted(const std::string& value, const StateRule& rule) {
  return std::ranges::equal(value, std::string_view(rule.wanted),
                            [](char a, char b) { return lower(a) == lower(b); });
}

/// The value as two answers in a row have it: a damaged one must be neither refused nor given back.
class Reader {
 public:
  explicit Reader(MarlinLink& link) : link_(link) {}

  std::optional<std::string> read(const StateRule& rule) {
    constexpr int kAttempts = 6;
    std::optional<std::string> before = value_in(answer(rule.read, false), rule.label);
    for (int i = 0; i < kAttempts && !(before && is_wanted(*before, rule)); ++i) {
      const std::optional<std::string> now = value_in(answer(rule.read, true), rule.label);
      if (now == before) break;
      before = now;
    }
    return before;
  }
  void forget() { answers_.clear(); }

 private:
  // M503 answers for several states, at length.
  const MarlinLink::Answer& answer(const char* command, bool again) {
    if (again || !answers_.contains(command))
      answers_[command] = run(link_, command).value_or(MarlinLink::Answer());
    return answers_[command];
  }
  MarlinLink& link_;
  std::map<std::string, MarlinLink::Answer> answers_;
};

std::string filled(std::string text, const std::string& value) {
  if (const std::size_t at = text.find('?'); at != std::string::npos) text.replace(at, 1, value);
  return text;
}

}  // namespace

void MachineState::set(MarlinLink& link, bool homed) {
  const unsigned dialect = dialect_of(link.capabilities());
  Reader reader(link);
  for (const StateRule& rule : kRules) {
    if ((rule.dialects & dialect) == 0 || (rule.homed && !homed)) continue;
    const std::string set = rule.set, read = rule.read, wanted = rule.wanted;
    const std::string name = rule.state + (" (" + set + ")");
    const auto known = std::ranges::find(changed_, name, &Changed::name);
    const std::string back = rule.back == nullptr ? "" : rule.back;
    if (known != changed_.end() && read.empty() && !back.empty()) continue;  // saved once
    std::optional<std::string> found;
    if (!read.empty()) found = reader.read(rule);
    const bool another = found && !is_wanted(*found, rule);
    const bool taken = !set.empty() && set_by(link, set);
    const bool gone = taken && (found ? another : rule.back != nullptr);
    if (gone && known == changed_.end())
      changed_.push_back({name, found || read.empty() ? filled(back, found.value_or("")) : ""});
    if (!another || *rule.if_not == 0) continue;
    if (!set.empty()) reader.forget(), found = reader.read(rule);
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
      taken = set_by(link, std::string(command)) && taken;
    if (taken) changed_.erase(changed_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

std::string MachineState::kept() const {
  std::string names;
  for (const Changed& changed : changed_) names += (names.empty() ? "" : ", ") + changed.name;
  return names;
}

std::optional<SoftLimits> soft_limits_of(MarlinLink& link) {
  if (dialect_of(link.capabilities()) != kMarlin) return std::nullopt;
  const MarlinLink::Answer answer = run(link, "M211").value_or(MarlinLink::Answer());
  for (const Reply& reply : answer.replies) {
    std::string text = reply.text;
    std::ranges::transform(text, text.begin(), lower);
    const std::size_t low = text.find("min:"), high = text.find("max:");
    if (text.find("soft endstops: on") == std::string::npos || low > high) continue;
    const auto point = [&](std::size_t from) {
      Point3 p;
      for (const auto& [axis, value] : {std::pair('x', &p.x), {'y', &p.y}, {'z', &p.z}}) {
        const std::size_t at = text.find(axis, from + 3);
        if (at == std::string::npos) return std::optional<Point3>();
        const std::string_view number = std::string_view(text).substr(at + 1, text.find(' ', at) - at - 1);
        const auto parsed = parse_double(number);
        if (!parsed) return std::optional<Point3>();
        *value = *parsed;
      }
      return std::optional(p);
    };
    if (const auto a = point(low), b = point(high); a && b) return SoftLimits{*a, *b, reply.text};
  }
  return std::nullopt;
}

}  // namespace supertac
