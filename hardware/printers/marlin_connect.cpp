// How a link finds the firmware at its port, or says what else is there.
#include <algorithm>

#include "hardware/printers/marlin_link.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// Seconds: for a board that boots, and between two M110 N0 meanwhile; in which Klipper finds its boards.
constexpr double kConnectDeadline = 20, kProbeInterval = 1, kKlipperStarts = 60;

}  // namespace

void MarlinLink::connect() {
  connected_ = false;
  const double until = port_.now() + kConnectDeadline;
  // Two answers in a row: the first ok may belong to something an earlier program sent.
  int answers = 0;
  while (answers < 2) {
    const double now = port_.now();
    if (now >= until) nobody_answered();
    answers = probe(std::min(until, now + kProbeInterval)) ? answers + 1 : 0;
  }
  number_ = 0;
  kept_.clear();
  read_capabilities();
  if (capabilities_.klipper) await_klipper();
  connected_ = true;
}

// Klipper's host answers from the moment it runs, but moves nothing before it has found its boards.
void MarlinLink::await_klipper() {
  const double until = port_.now() + kKlipperStarts;
  for (;;) {
    try {
      command("G21");
      return;
    } catch (const PrinterRefused& refused) {
      if (std::string_view(refused.what()).find("Printer is not ready") == std::string_view::npos ||
          port_.now() > until)
        throw;
    }
    idle(1);
  }
}

void MarlinLink::nobody_answered() {
  const std::string expected = "port " + port_.name() + ": expected a Marlin firmware, found ";
  const std::string within = " answer to M110 within " + format(kConnectDeadline, 0) + " s; ";
  const unsigned baud = port_.baud();
  if (bytes_ > 0) {
    throw WrongDevice(expected + std::to_string(bytes_) + " bytes that are no" + within +
                      "check that it is the printer's port (supertac-check machine)" +
                      (baud > 0 ? " and that its baud rate is " + std::to_string(baud) : "") +
                      (complaint_.empty() ? "" : "; it said " + in_quotes(complaint_)));
  }
  throw PrinterSilent(expected + "no" + within + "check that the printer is on and the port is right");
}

void MarlinLink::refuse_board() const {
  constexpr std::size_t kFewFrames = 3 * rig::kFrameBytes;
  if (bytes_ > kFewFrames && 3 * no_text_ > bytes_)
    throw WrongDevice("port " + port_.name() +
                      ": expected a Marlin printer, found no text, as from a tactile board; exchange the two "
                      "ports");
}

bool MarlinLink::probe(double until) {
  send("\n" + numbered_line(0, "M110 N0"));
  std::string line;
  while (read_line(until, line)) {
    const Reply reply = parse_reply(line);
    if (reply.kind == ReplyKind::fatal) check_alarm(reply);
    if (reply.kind == ReplyKind::other || reply.kind == ReplyKind::error || reply.kind == ReplyKind::paused)
      complaint_ = line;
    if (reply.kind != ReplyKind::ok) continue;
    settle();
    return true;
  }
  refuse_board();
  return false;
}

void MarlinLink::read_capabilities() {
  // Damage makes no known name of another one: a name that is none is asked for again.
  constexpr std::string_view kName = "FIRMWARE_NAME:";
  std::string& firmware = capabilities_.firmware;
  bool marlin = false, parser = false;
  for (int attempt = 0; attempt < kAttempts && !(marlin && parser) && !capabilities_.klipper; ++attempt) {
    for (const Reply& reply : command("M115").replies) {
      if (const std::size_t at = reply.text.find(kName); at != std::string::npos && !marlin) {
        const std::string_view rest = trimmed(std::string_view(reply.text).substr(at + kName.size()));
        const std::size_t next = rest.find(':');  // of what is told behind it
        firmware = next == rest.npos ? rest : rest.substr(0, rest.rfind(' ', next));
      }
      parser = parser || reply.text.starts_with("Cap:EMERGENCY_PARSER:");
      if (reply.text == "Cap:EMERGENCY_PARSER:1") capabilities_.emergency_parser = true;
    }
    marlin = firmware.find("Marlin") != std::string::npos;
    capabilities_.klipper = firmware.starts_with("Klipper");
  }
  if (!marlin && !capabilities_.klipper)
    throw WrongDevice("port " + port_.name() + ": expected Marlin or Klipper, found " +
                      (firmware.empty() ? "none" : in_quotes(firmware)) +
                      " as its name (M115), which is neither; use a printer with one of the two");
}

}  // namespace supertac
