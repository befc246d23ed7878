// What supertac-collect does, without its output.
#include "hardware/collection/collection.h"

#include "hardware/ports/errors.h"

namespace supertac {
namespace {

void check_stop(const RecorderSettings& settings, JournalWriter& journal) {
  if (settings.stop()) throw OperatorStop("stopped by the operator");
  journal.check();
}

PalpationObserver observer_for(const RecorderSettings& settings, JournalWriter& journal,
                               SensorReader& board) {
  PalpationObserver observer;
  observer.leg_started = [&](const Leg& leg) { journal.event(leg.accepted_s, event_text(leg, false)); };
  observer.leg_ended = [&](const Leg& leg) { journal.event(leg.ended_s, event_text(leg, true)); };
  observer.position = [&](const Leg& leg, const PositionSample& sample) {
    journal.event(sample.time_s, event_text(sample));
    if (settings.progress) settings.progress(leg, sample.position, board.counters());
  };
  observer.check = [&] {
    check_stop(settings, journal);
    board.check();
  };
  observer.contact = settings.contact;
  return observer;
}

// Nothing moves before the board has been heard: a wrong port would otherwise be found with the finger on its
// way.
void hear_board(SensorReader& board, Printer& printer, const RecorderSettings& settings,
                JournalWriter& journal) {
  printer.link().idle(0.1 + board.silence_s());
  for (int i = 0; i < 100 && !board.next(0.02); ++i) check_stop(settings, journal);  // throws what ended it
}

RecorderReport record(std::unique_ptr<Port> board_port, std::unique_ptr<Port> printer_port,
                      const RecorderSettings& settings, JournalWriter& journal) {
  CapturedPort captured(std::move(printer_port), journal, JournalStream::printer);
  Printer printer(captured, settings.bed.limits);
  printer.link().set_watch([&] { check_stop(settings, journal); });
  // Of a run whose printer says for ever that it is busy.
  printer.link().give_up_at(captured.now() + 3 * planned_s(settings.bed) + 300);
  RecorderReport report;
  try {
    printer.connect();
    settings.home ? printer.home() : printer.confirm_origin(settings.bed.origin);
    auto port = std::make_unique<CapturedPort>(std::move(board_port), journal, JournalStream::board);
    SensorReader board({.port = std::move(port)}, settings.sensor, settings.reader);
    hear_board(board, printer, settings, journal);
    report.outcome = run_palpation(printer, settings.bed.plan, observer_for(settings, journal, board));
    report.kept = printer.put_back();
  } catch (...) {
    printer.put_back();
    throw;
  }
  if (report.outcome.complete) journal.event(captured.now(), kRunComplete);
  try {
    journal.close();
  } catch (const JournalError&) {
    report.outcome.complete = false;
    if (!report.outcome.error) report.outcome.error = std::current_exception();
  }
  return report;
}

}  // namespace

RecorderReport record_palpation(std::unique_ptr<Port> board, std::unique_ptr<Port> printer,
                                const RecorderSettings& settings) {
  JournalWriter journal(settings.journal, settings.header);
  try {
    return record(std::move(board), std::move(printer), settings, journal);
  } catch (...) {
    journal.discard();
    throw;
  }
}

}  // namespace supertac
