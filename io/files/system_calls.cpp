#include "io/files/system_calls.h"

#include <unistd.h>

#include <cstdio>

namespace supertac {

SystemCalls real_system_calls() {
  return {
      .open = [](const char* path, int flags, mode_t mode) { return ::open(path, flags, mode); },
      .fstat = [](int file, struct stat* status) { return ::fstat(file, status); },
      .read = ::read,
      .pread = ::pread,
      .write = ::write,
      .fsync = ::fsync,
      .close = ::close,
      .rename = [](const char* from, const char* to) { return std::rename(from, to); },
      .unlink = ::unlink,
  };
}

SystemCalls& system_calls() {
  static SystemCalls calls = real_system_calls();
  return calls;
}

}  // namespace supertac
