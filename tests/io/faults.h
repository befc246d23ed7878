// The N-th system call fails: a table for io/files/system_calls.h that counts and injects.
#pragma once

#include <cerrno>
#include <mutex>
#include <string>
#include <vector>

#include "io/files/system_calls.h"

namespace supertac {

enum class Fault { error, short_count };

class FaultInjection {
 public:
  /// Call number `at` (from 1) fails, with `forever` all that follow as well. unlink only fails by itself:
  /// whoever cannot remove anything cannot clean up.
  FaultInjection(int at, int error, bool forever, Fault fault = Fault::error) {
    state() = {at, error, forever, fault, 0, {}};
    auto& calls = system_calls();
    calls.open = [](auto... a) { return hit("open") ? -1 : real_system_calls().open(a...); };
    calls.fstat = [](auto... a) { return hit("fstat") ? -1 : real_system_calls().fstat(a...); };
    calls.read = [](int file, void* bytes, std::size_t count) {
      return transfer("read", real_system_calls().read, file, bytes, count);
    };
    calls.pread = [](int file, void* bytes, std::size_t count, off_t offset) {
      return transfer("pread", real_system_calls().pread, file, bytes, count, offset);
    };
    calls.write = [](int file, const void* bytes, std::size_t count) {
      return transfer("write", real_system_calls().write, file, bytes, count);
    };
    calls.fsync = [](int file) { return hit("fsync") ? -1 : real_system_calls().fsync(file); };
    calls.close = [](int file) {
      const int result = real_system_calls().close(file);  // the descriptor is gone in any case
      return hit("close") ? -1 : result;
    };
    calls.rename = [](auto... a) { return hit("rename") ? -1 : real_system_calls().rename(a...); };
    calls.rename_new = [](auto... a) { return hit("rename") ? -1 : real_system_calls().rename_new(a...); };
  }
  ~FaultInjection() { system_calls() = real_system_calls(); }
  FaultInjection(const FaultInjection&) = delete;
  FaultInjection& operator=(const FaultInjection&) = delete;

  /// Names of the calls made, in order.
  static const std::vector<std::string>& calls() { return state().log; }
  static bool reached() { return state().count >= state().at; }

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
  /// A call that moves `count` bytes: all, none, or half of them.
  static ssize_t transfer(const char* name, auto call, int file, auto bytes, std::size_t count, auto... at) {
    const bool now = hit(name);
    if (now && state().fault == Fault::error) return -1;
    return call(file, bytes, now ? (count + 1) / 2 : count, at...);
  }
  /// Counts a call; true when it is to fail. A short count can only befall read and write.
  static bool hit(const char* name) {
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
};

}  // namespace supertac
