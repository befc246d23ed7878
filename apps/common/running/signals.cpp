#include "apps/common/running/signals.h"

#include <atomic>
#include <csignal>

namespace supertac {
namespace {

std::atomic<int> signal_number{0};
static_assert(std::atomic<int>::is_always_lock_free, "usable in a signal handler");

void remember(int number) { signal_number = number; }

// With SA_RESETHAND the kernel gives a signal its default action back as it delivers it: none can come
// between.
void take_signals(int flags) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    sigaction(number, nullptr, &before);
    if (number == SIGHUP && before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = remember;
    action.sa_flags = flags;
    sigemptyset(&action.sa_mask);
    sigaction(number, &action, nullptr);
  }
}

}  // namespace

void catch_signals() {
  std::signal(SIGPIPE, SIG_IGN);  // a reader of stdout that went away must not cost the files under way
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on file sizes is then an error of write(), like a full disk
  take_signals(SA_RESETHAND);
}

FinishDespiteSignals::FinishDespiteSignals() { take_signals(0); }

FinishDespiteSignals::~FinishDespiteSignals() { take_signals(SA_RESETHAND); }

bool interrupted() { return signal_number != 0; }

int interrupting_signal() { return signal_number; }

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted();
}

}  // namespace supertac
