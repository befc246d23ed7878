// How a signal, such as Ctrl-C, ends a program.
#pragma once

namespace supertac {

/// Takes SIGINT, SIGTERM and SIGHUP as a wish to stop: the first one sets a flag that long work looks at, a
/// second one of the same kind ends the program at once. A SIGHUP ignored by the caller (nohup) stays
/// ignored; a SIGINT that a script ignores for what it starts in the background does not: a printer that
/// moves must be stoppable.
void catch_signals();

/// While it lives a second signal does not end the program either: there is something that may not be left as
/// it is, such as a finger in contact. A terminal that is closed sends SIGHUP twice, an impatient hand
/// SIGINT.
class FinishDespiteSignals {
 public:
  FinishDespiteSignals();
  ~FinishDespiteSignals();
  FinishDespiteSignals(const FinishDespiteSignals&) = delete;
  FinishDespiteSignals& operator=(const FinishDespiteSignals&) = delete;
};

/// True once such a signal came.
bool interrupted();

/// Its number, or 0. Exit code is 128 + number.
int interrupting_signal();

/// Thrown to leave long work after a signal; the wrapper of the programs turns it into the exit code.
class Interrupted {};

/// Throws Interrupted when interrupted().
void stop_if_interrupted();

}  // namespace supertac
