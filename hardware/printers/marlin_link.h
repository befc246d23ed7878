// Marlin's line protocol over any port: numbered lines with checksums, one in flight, repeated until the
// firmware is known to have run them, and never run twice: a number runs once. Marlin since 2.1.2 ignores a
// repeated line in silence, older ones complain; both answer a line numbered far ahead with the last number
// that they took, and that is how a lost answer is asked for. Klipper takes the same lines and checks no
// number.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "data/sensors/rig.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/port.h"

namespace supertac {

// The text of the protocol: numbered lines with checksums, and what a reply means (marlin_line.cpp).

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

constexpr int kAttempts = 6;  ///< at an answer that is not damaged

/// What a firmware says of itself (M115).
struct MarlinCapabilities {
  std::string firmware;           ///< its name and version, the text behind FIRMWARE_NAME
  bool emergency_parser = false;  ///< M112 and M410 act as soon as they arrive, ahead of the queue
  bool klipper = false;           ///< Klipper's host: it asks for no line again, has no M410 and no M114 R
};

/// One firmware at one port: sends it commands one at a time, and knows which of them have run. For one
/// thread. Times are seconds of the port's clock.
class MarlinLink {
 public:
  /// What the firmware said to one command, and when.
  struct Answer {
    std::vector<Reply> replies;  ///< the lines before its ok, oldest first
    double sent_s = 0;           ///< before its line was written for the first time
    double answered_s = 0;       ///< when its ok arrived, or another answer that proves that it was taken
    bool repeated = false;       ///< its line was sent or asked for again: when it ran is little known
  };

  /// `port` must outlive the link.
  explicit MarlinLink(Port& port) : port_(port) {}

  /// Finds a fresh (`start` banner) or a running firmware, sets its line number to 0, reads M115; waits for a
  /// Klipper that still starts. Throws PrinterSilent; WrongDevice when what comes is no such firmware's
  /// answer, with what it said; PrinterHalted.
  void connect();

  /// Runs one command and returns when the firmware has acknowledged it. `deadline_s` 0: 2.5 s;
  /// commands that take long (M400, G4, G28) need their own. Throws PrinterSilent, PrinterReset,
  /// PrinterHalted, ResendLoop, PrinterPaused, PrinterRefused, PortUnplugged, PortTimeout. A move of
  /// Klipper's is sent once, and whoever sends it has to ask where it leads.
  Answer command(std::string_view code, double deadline_s = 0);

  /// Sends `code` (M410, M112, M108) without number, ahead of everything: only the emergency parser sees it
  /// in time; without one it waits its turn.
  void emergency(std::string_view code);

  /// From now on a pause ends no wait: it is answered by M108, and the wait goes on.
  void answer_pauses() { answers_pauses_ = true; }

  /// M410, after a command that an exception interrupted. The next command may be sent at once: it waits in
  /// the firmware for the end of the stop, and takes neither the ok of the interrupted one nor M410's
  /// for its own.
  void stop();

  /// After a command that an exception interrupted: reads until it has been acknowledged, `seconds` at most,
  /// then what still comes (settle()). Throws as idle().
  void abandon(double seconds);

  /// From this time of the port's clock on every wait throws PrinterSilent, which bounds a whole run.
  void give_up_at(double time_s) { give_up_s_ = time_s; }

  /// Reads and forgets replies for `seconds`; the way to wait while the port's clock runs.
  /// Throws PrinterReset, PrinterHalted when one of the replies says so.
  void idle(double seconds);

  /// Reads replies until for 0.05 s none came but automatic reports (at most 2 s). Throws PrinterReset,
  /// PrinterHalted, PrinterPaused when one of them says so.
  void settle();

  /// Called at least every 0.02 s while waiting for the firmware; what it throws ends the wait.
  void set_watch(std::function<void()> watch) { watch_ = std::move(watch); }

  const MarlinCapabilities& capabilities() const { return capabilities_; }
  /// Lines sent again, of the whole connection.
  std::uint64_t repeats() const { return repeats_; }
  bool halted() const { return halted_; }
  /// Connected, and neither halted nor restarted since.
  bool in_use() const { return connected_ && !halted_; }
  Port& port() { return port_; }

 private:
  struct Exchange;

  Exchange exchange_of(std::string_view code, double deadline_s);
  bool probe(double until);
  [[noreturn]] void nobody_answered();
  void refuse_board() const;
  void read_capabilities();
  void await_klipper();
  /// Sends the exchange's current line again.
  void repeat(Exchange& exchange, const std::string& why);
  /// Asks for the last line taken, by one numbered far ahead.
  void ask(Exchange& exchange);
  /// Counts and limits what is sent again.
  void count_copy(Exchange& exchange, const std::string& why);
  void on_reply(Exchange& exchange, Reply reply);
  void on_ok(Exchange& exchange);
  void give_back(Exchange& exchange);
  void on_unknown_command(Exchange& exchange, const Reply& reply);
  void on_last_line(Exchange& exchange, std::int64_t last);
  void finish(const Exchange& exchange);
  void forget();
  void heed(const Reply& reply);
  void check_alarm(const Reply& reply);
  /// Returns the port's time (s) before the write. Throws as Port::write().
  double send(const std::string& text);
  /// The next line of what has been received already, not empty, without its break and trailing blanks; false
  /// when there is none.
  bool take_line(std::string& line);
  /// Waits for it; false when `until` (s, on the port's clock) passes first, also where bytes or lines come
  /// for ever. Throws as Port::read(), and PrinterSilent when it is time to give up.
  bool read_line(double until, std::string& line);

  Port& port_;
  std::function<void()> watch_;
  std::string input_;                    // received, not yet a whole line
  double arrival_s_ = 0;                 // of the last byte received
  std::size_t bytes_ = 0, no_text_ = 0;  // received so far; those that stand in no text (is_text())
  MarlinCapabilities capabilities_;
  std::uint64_t repeats_ = 0;
  std::string complaint_;         // what was said since an ok; the cause of a halt stands before it
  std::deque<std::string> kept_;  // lines number_ - kept_.size() + 1 ... number_
  std::int64_t number_ = 0;       // of the newest line
  double give_up_s_ = std::numeric_limits<double>::infinity();
  bool connected_ = false;
  bool halted_ = false;
  int owed_ = 0;  // oks of what has been sent
  bool answers_pauses_ = false;
};

}  // namespace supertac
