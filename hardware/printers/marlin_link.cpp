#include "hardware/printers/marlin_link.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// Seconds: of an ordinary command (Marlin's first echo:busy comes after 2 s); after echo:busy (repeated every
// 2 s); for one command, behind a longer deadline of its own, whatever is said; of silence that ends a
// disturbance.
constexpr double kOkDeadline = 2.5, kBusyDeadline = 6, kLongestWait = 60, kQuiet = 0.05;
constexpr int kMaxRepeats = 8;          // of one line, for any reason; four times as many while catching up
constexpr std::size_t kKeptLines = 64;  // of the newest lines, for Resend
// With one line in flight the firmware is never honestly more than a line or two behind. A number further
// back is damaged text, or a firmware that restarted; the second time in a row it is believed.
constexpr std::int64_t kPlausibleLag = 4;
constexpr std::int64_t kFarAhead = 1000;  // no firmware takes such a number for a repetition

}  // namespace

double MarlinLink::send(const std::string& text) {
  constexpr double kWriteDeadline = 2;  // s
  const double before = port_.now();
  port_.write(std::as_bytes(std::span(text)), before + kWriteDeadline);
  return before;
}

bool MarlinLink::take_line(std::string& line) {
  for (;;) {
    const std::size_t end = input_.find_first_of("\r\n");
    if (end == std::string::npos) return false;
    line.assign(input_, 0, end);
    input_.erase(0, end + 1);
    while (!line.empty() && line.back() == ' ') line.pop_back();
    if (!line.empty()) return true;
  }
}

bool MarlinLink::read_line(double until, std::string& line) {
  constexpr double kWatchInterval = 0.02;  // a fifth of the 0.1 s in which an unplugged board must be noticed
  std::array<std::byte, 4096> buffer{};    // no line is longer
  until = std::min(until, give_up_s_);
  bool answered = take_line(line);
  double now = arrival_s_;
  while (!answered && now < until) {  // bytes or lines may come for ever
    if (watch_) watch_();
    const Received got = port_.read(buffer, watch_ ? std::min(until, port_.now() + kWatchInterval) : until);
    now = got.time_s;
    if (got.count > 0) arrival_s_ = now;
    bytes_ += got.count;
    const auto bytes = std::span(buffer).first(got.count);
    no_text_ +=
        static_cast<std::size_t>(std::ranges::count_if(bytes, [](std::byte b) { return !is_text(b); }));
    input_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (input_.size() > buffer.size() && input_.find_first_of("\r\n") == std::string::npos) input_.clear();
    answered = take_line(line);
  }
  if (now < give_up_s_) return answered;
  throw PrinterSilent("printer " + port_.name() + ": did not come to an end in time" +
                      (complaint_.empty() ? "" : ", it said " + in_quotes(complaint_)) +
                      "; check the printer and start again");
}

struct MarlinLink::Exchange {
  std::int64_t number;  // of the command
  std::int64_t cursor;  // line now in flight: earlier than `number` while catching up
  double deadline_s;
  double until = 0;  // for the next answer
  double limit = 0;  // for all of them
  Answer answer = {};
  int repeats = 0;     // of the line at `cursor`
  int copies = 0;      // of all lines; progress does not reset it
  bool fault = false;  // the next ok acknowledges nothing
  bool asked = false;  // an ok may be that of the question
  bool done = false;
  bool proven = false;         // by Last Line, not by an ok
  std::int64_t fallback = -1;  // implausibly old line the firmware named last
  std::string code = {};       // as sent
  std::string error = {};      // unfamiliar Error: of the command itself
  bool error_stands = false;   // and the firmware did run it
  bool once = false;           // never sent again, whatever became of it
};

MarlinLink::Answer MarlinLink::command(std::string_view code, double deadline_s) {
  Exchange exchange = exchange_of(code, deadline_s);
  // Taken is not finished: the ok of a command behind it in the queue tells when a long one has ended.
  for (int attempt = 0; exchange.proven && deadline_s > kOkDeadline; ++attempt) {
    if (attempt == kAttempts)
      throw PrinterSilent("printer " + port_.name() + ": expected an ok to M400 behind " + in_quotes(code) +
                          ", found none of " + std::to_string(kAttempts) +
                          "; check the printer and the cable");
    const Exchange behind = exchange_of("M400", deadline_s);
    exchange.answer.answered_s = behind.answer.answered_s;
    exchange.proven = behind.proven;
  }
  return std::move(exchange.answer);
}

MarlinLink::Exchange MarlinLink::exchange_of(std::string_view code, double deadline_s) {
  if (halted_) throw PrinterHalted("printer " + port_.name() + ": halted earlier; reset it and start again");
  std::string early;  // what was read before a question is no answer to it
  while (take_line(early)) check_alarm(parse_reply(early));
  const std::string text = capabilities_.emergency_parser ? shielded(code) : std::string(code);
  kept_.push_back(numbered_line(number_ + 1, text));
  ++number_;
  if (kept_.size() > kKeptLines) kept_.pop_front();
  Exchange exchange{number_, number_, deadline_s > 0 ? deadline_s : kOkDeadline};
  exchange.code = text;
  exchange.once = capabilities_.klipper && code.starts_with("G1 ");
  exchange.answer.repeated = owed_ > 0;  // and an ok may have been lost
  exchange.answer.sent_s = send(kept_.back());
  ++owed_;
  exchange.until = exchange.answer.sent_s + exchange.deadline_s;
  // Behind its deadline a long command may still have to be asked for.
  const double usual_s = deadline_s > kOkDeadline ? deadline_s : 0;
  exchange.limit = exchange.answer.sent_s + usual_s + kLongestWait;
  std::string line = "nothing";
  while (!exchange.done) {
    const bool answered = read_line(std::min(exchange.until, exchange.limit), line);
    if (answered) on_reply(exchange, parse_reply(line));
    const double now = answered ? arrival_s_ : port_.now();
    if (!exchange.done && now >= exchange.limit) {
      throw PrinterSilent("printer " + port_.name() + ": expected the end of " + in_quotes(code) +
                          " within " + format(exchange.limit - exchange.answer.sent_s, 0) +
                          " s, found other answers (" + in_quotes(line) +
                          " last); check the printer and start again");
    }
    if (answered) continue;
    exchange.once ? give_back(exchange) : ask(exchange);
  }
  owed_ = 0;
  finish(exchange);
  return exchange;
}

void MarlinLink::finish(const Exchange& exchange) {
  // After a disturbance a late second answer may be under way; taken for the next line's it would shift
  // every later answer by one.
  if (exchange.answer.repeated) settle();
  if (exchange.error_stands) {
    throw PrinterRefused("printer " + port_.name() + ": refused " +
                         in_quotes(kept_.back().substr(0, kept_.back().size() - 1)) + ": " +
                         printable(exchange.error, 200));
  }
}

void MarlinLink::count_copy(Exchange& exchange, const std::string& why) {
  const bool loop = ++exchange.copies > 4 * kMaxRepeats;
  if (++exchange.repeats > kMaxRepeats || loop) {
    const std::string text = "printer " + port_.name() + ": line " + std::to_string(exchange.cursor) +
                             " repeated " + std::to_string((loop ? exchange.copies : exchange.repeats) - 1) +
                             " times without success (" + why + ")";
    if (exchange.fault || loop) throw ResendLoop(text + ": resend loop; check the cable and start again");
    throw PrinterSilent(text + (complaint_.empty() ? "" : ", it said " + in_quotes(complaint_)) +
                        "; check the printer and the cable");
  }
  exchange.answer.repeated = true;
  exchange.fault = exchange.asked = false;
  ++repeats_;
  forget();
}

void MarlinLink::repeat(Exchange& exchange, const std::string& why) {
  count_copy(exchange, why);
  // The line break ends what may be left of a damaged line; Marlin ignores empty ones.
  exchange.until = exchange.deadline_s +
                   send("\n" + kept_[kept_.size() - 1 - static_cast<std::size_t>(number_ - exchange.cursor)]);
}

void MarlinLink::ask(Exchange& exchange) {
  count_copy(exchange, "no answer");
  exchange.asked = !capabilities_.klipper;
  exchange.until = kOkDeadline + send("\n" + numbered_line(number_ + kFarAhead, "M105"));
}

void MarlinLink::on_reply(Exchange& exchange, Reply reply) {
  check_alarm(reply);
  // Klipper numbers nothing, and would run again what is sent again.
  const bool of_lines = reply.kind == ReplyKind::line_fault || reply.kind == ReplyKind::resend;
  if (capabilities_.klipper && of_lines) return;
  switch (reply.kind) {
    case ReplyKind::ok:
      if (owed_ == 0) on_ok(exchange);
      if (reply.text.size() > 2) exchange.answer.replies.push_back(std::move(reply));  // Klipper's M115
      break;
    case ReplyKind::paused:
      exchange.answer.repeated = true;  // M108, which answers it, has an ok of its own
      [[fallthrough]];
    case ReplyKind::busy:
      exchange.until = std::max(exchange.until, arrival_s_ + kBusyDeadline);
      break;
    case ReplyKind::line_fault:
      exchange.fault = true;
      if (reply.number) on_last_line(exchange, *reply.number);
      break;
    case ReplyKind::resend:
      exchange.fault = true;
      exchange.error.clear();  // the Error: before it was a damaged complaint about the line
      // A line never sent cannot be sent again. What ran is known from Last Line, not from here.
      if (reply.number && *reply.number <= exchange.number) on_last_line(exchange, *reply.number - 1);
      break;
    case ReplyKind::unknown_command:
      on_unknown_command(exchange, reply);
      break;
    case ReplyKind::error:
      exchange.error = reply.text;
      // Klipper complains of what it has read right, once.
      (capabilities_.klipper ? exchange.error_stands : exchange.fault) = true;
      break;
    case ReplyKind::wait:
    case ReplyKind::temperature:
      break;
    default:
      if (exchange.answer.replies.size() < 256) exchange.answer.replies.push_back(std::move(reply));
  }
}

// Acknowledged by the ok that follows, but not run. Marlin quotes the whole line, Klipper its first word:
// where that came through the firmware does not know it, otherwise the line was damaged.
void MarlinLink::on_unknown_command(Exchange& exchange, const Reply& reply) {
  const std::string word = exchange.code.substr(0, exchange.code.find(' '));
  exchange.error_stands = reply.text == "echo:Unknown command: \"" + exchange.code + '"' ||
                          reply.text == "// Unknown command:\"" + word + '"';
  if (exchange.error_stands) {
    exchange.error = reply.text;
    return;
  }
  exchange.fault = true;
}

// Klipper checks no line: a damaged move may run as another one, and only its queue's end tells.
void MarlinLink::give_back(Exchange& exchange) {
  exchange.done = exchange.answer.repeated = true;
  exchange.answer.answered_s = port_.now();
}

void MarlinLink::on_ok(Exchange& exchange) {
  exchange.answer.answered_s = arrival_s_;
  if (exchange.done) return;
  if (exchange.asked && !exchange.fault) return;  // late, or the question's: the last line taken decides
  if (exchange.fault && exchange.once) return give_back(exchange);
  if (exchange.fault) {
    repeat(exchange,
           exchange.error.empty() ? "the firmware reports damaged lines" : printable(exchange.error));
    return;
  }
  if (exchange.cursor == exchange.number) {
    exchange.done = true;
    return;
  }
  ++exchange.cursor;
  exchange.repeats = 0;
  repeat(exchange, "catching up");
}

void MarlinLink::on_last_line(Exchange& exchange, std::int64_t last) {
  if (last >= exchange.number) {
    if (last > exchange.number) return;  // damaged text
    exchange.done = true;                // it was taken: its ok was lost
    exchange.proven = true;
    exchange.answer.answered_s = arrival_s_;
    exchange.answer.repeated = true;
    exchange.error_stands = !exchange.error.empty();
    return;
  }
  const std::int64_t next = std::max<std::int64_t>(last + 1, 0);
  if (next < exchange.number - kPlausibleLag) {
    const bool believed = exchange.fallback == next;
    exchange.fallback = next;
    if (!believed) return;
    if (next <= 1) {
      connected_ = false;
      throw PrinterReset("printer " + port_.name() + ": its line number fell back from " +
                         std::to_string(exchange.number - 1) +
                         " to 0, so it restarted; its position is unknown");
    }
  }
  if (next <= number_ - static_cast<std::int64_t>(kept_.size())) {
    throw ResendLoop("printer " + port_.name() + ": asks for line " + std::to_string(next) + ", kept are " +
                     std::to_string(number_ - static_cast<std::int64_t>(kept_.size()) + 1) + " to " +
                     std::to_string(number_) + "; start again");
  }
  if (next != exchange.cursor) exchange.repeats = std::max(0, exchange.repeats - 1);
  exchange.cursor = next;
}

void MarlinLink::emergency(std::string_view code) { send("\n" + std::string(code) + "\n"); }

void MarlinLink::stop() {
  emergency("M410");
  ++owed_;
}

void MarlinLink::abandon(double seconds) {
  const double until = port_.now() + seconds;
  std::string line;
  while (owed_ > 0 && read_line(until, line)) check_alarm(parse_reply(line));
  settle();
}

void MarlinLink::idle(double seconds) {
  const double until = port_.now() + seconds;
  std::string line;
  while (read_line(until, line)) check_alarm(parse_reply(line));
}

void MarlinLink::settle() {
  const double limit = port_.now() + 2;
  std::string line;
  double quiet_until = port_.now() + kQuiet;
  while (read_line(std::min(quiet_until, limit), line)) {
    const Reply reply = parse_reply(line);
    heed(reply);
    // Reports come for ever; what is waited for is the end of answers.
    const bool report = reply.kind == ReplyKind::position || reply.kind == ReplyKind::temperature;
    if (!report) quiet_until = arrival_s_ + kQuiet;
  }
  forget();
  owed_ = 0;
}

// Answers, and half an answer such as an ok whose line break was lost; not what is said unasked.
void MarlinLink::forget() {
  std::string line;
  while (take_line(line)) heed(parse_reply(line));
  input_.erase(input_.find_last_of("\r\n") + 1);
}

void MarlinLink::heed(const Reply& reply) {
  for (const ReplyKind alarm :
       {ReplyKind::start, ReplyKind::fatal, ReplyKind::paused, ReplyKind::interrupted})
    if (reply.kind == alarm) check_alarm(reply);
}

void MarlinLink::check_alarm(const Reply& reply) {
  if (reply.kind == ReplyKind::ok) {
    complaint_.clear();
    owed_ -= owed_ > 0 ? 1 : 0;
  }
  for (const char* mark : {"echo:", "// ", "!! ", "Error:"}) {
    // Klipper says the cause first, and then at length what may be done.
    const bool stands = complaint_.starts_with("// ") || complaint_.starts_with("!! ");
    if (reply.text.starts_with(mark) && reply.kind != ReplyKind::fatal && !stands) complaint_ = reply.text;
  }
  if (reply.kind == ReplyKind::fatal) {
    halted_ = true;
    throw PrinterHalted("printer " + port_.name() + ": the firmware halted (" +
                        (complaint_.empty() ? "" : in_quotes(complaint_) + ", ") + in_quotes(reply.text) +
                        "); nothing more is sent, reset the printer and check it");
  }
  if (!connected_) return;
  if (reply.kind == ReplyKind::start) {
    connected_ = false;
    throw PrinterReset(
        "printer " + port_.name() +
        ": the firmware restarted in use; its position is unknown, confirm the origin and start "
        "again; it said " +
        in_quotes(reply.text));
  }
  if (reply.kind != ReplyKind::paused && reply.kind != ReplyKind::interrupted) return;
  if (answers_pauses_) {
    if (reply.kind == ReplyKind::paused) emergency("M108");
    return;
  }
  throw PrinterPaused("printer " + port_.name() + ": " +
                      (reply.kind == ReplyKind::paused
                           ? "waits for its user; look at the printer's display and start again"
                           : "was stopped or paused at its display, or by itself (" + in_quotes(reply.text) +
                                 "); look at it and start again"));
}

}  // namespace supertac
