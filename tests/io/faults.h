// The N-th call on a file fails: the linker leads the calls of a test program that uses supertac_faults
// through faults.cpp (--wrap), which counts and injects.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <mutex>
#include <string>
#include <vector>

namespace supertac {

enum class Fault { error, short_count };

class FaultInjection {
 public:
  /// Call number `at` (from 1) fails, with `forever` all that follow as well. unlink only fails by itself:
  /// whoever cannot remove anything cannot clean up.
  FaultInjection(int at, int error, bool forever, Fault fault = Fault::error) {
    state() = {at, error, forever, fault, 0, {}};
    active() = true;
  }
  ~FaultInjection() { active() = false; }
  FaultInjection(const FaultInjection&) = delete;
  FaultInjection& operator=(const FaultInjection&) = delete;

  /// Names of the calls made, in order.
  static const std::vector<std::string>& calls() { return state().log; }
  static bool reached() { return state().count >= state().at; }

  /// For faults.cpp. A call that moves `count` bytes: all, none, or half of them.
  static ssize_t transfer(const char* name, auto call, int file, auto bytes, std::size_t count, auto... at) {
    const bool now = hit(name);
    if (now && state().fault == Fault::error) return -1;
    return call(file, bytes, now ? (count + 1) / 2 : count, at...);
  }
  /// Counts a call; true when it is to fail. A short count can only befall read and write.
  static bool hit(const char* name) {
    if (!active()) return false;
    static std::mutex mutex;  // a journal writes and syncs in two threads
    const std::lock_guard lock(mutex);
    State& s = state();
    s.log.emplace_back(name);
    ++s.count;
    const bool now = s.count == s.at || (s.forever && s.count > s.at);
    const std::string call = name;
    if (!now || (s.fault == Fault::short_count && call != "read" && call != "write")) return false;
    errno = s.error;
    return true;
  }

 private:
  struct State {
    int at, error;
    bool forever;
    Fault fault;
    int count;
    std::vector<std::string> log;
  };
  static State& state() {
    static State state{};
    return state;
  }
  static std::atomic<bool>& active() {
    static std::atomic<bool> active{false};
    return active;
  }
};

}  // namespace supertac
