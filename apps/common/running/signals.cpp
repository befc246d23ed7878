#include "apps/common/running/signals.h"

#include <atomic>
#include <csignal>

namespace supertac {
namespace {

std::atomic<int> signal_number{0};
static_assert(std::atomic<int>::is_always_lock_free, "usable in a signal handler");

std::atomic<bool> must_finish{false};
static_assert(std::atomic<bool>::is_always_lock_free, "usable in a signal handler");

void remember(int number) {
  signal_number = number;
  if (!must_finish) std::signal(number, SIG_DFL);
}

}  // namespace

void catch_signals() {
  std::signal(SIGPIPE, SIG_IGN);  // a reader of stdout that went away must not cost the files under way
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on file sizes is then an error of write(), like a full disk
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    sigaction(number, nullptr, &before);
    if (number == SIGHUP && before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = remember;
    sigemptyset(&action.sa_mask);
    sigaction(number, &action, nullptr);
  }
}

FinishDespiteSignals::FinishDespiteSignals() { must_finish = true; }

FinishDespiteSignals::~FinishDespiteSignals() { must_finish = false; }

bool interrupted() { return signal_number != 0; }

int interrupting_signal() { return signal_number; }

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted();
}

}  // namespace supertac
