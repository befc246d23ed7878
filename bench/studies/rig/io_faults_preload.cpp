// Preloaded into a program (LD_PRELOAD): the N-th open, write, fsync, close or rename of a file below a
// folder fails. SUPERTAC_FAULT = "N once|forever error|short ERRNO FOLDER". The file SUPERTAC_FAULT_COUNT
// keeps the number of calls seen, and of those that failed and on which something depends: all but the close
// of a directory or a file through which nothing was written. That one can lose nothing, and need not be
// told.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <bitset>
#include <mutex>

namespace {

struct Plan {
  int at = 0, error = 0;
  bool forever = false, is_short = false;
  char folder[4096] = {};
};

constexpr int kMostFiles = 1024;
std::bitset<kMostFiles> watched, written;
std::mutex mutex;
int calls = 0, grave = 0;

const Plan& plan() {
  static const Plan plan = [] {
    Plan p;
    char often[16] = {}, kind[16] = {};
    const char* text = getenv("SUPERTAC_FAULT");
    if (text != nullptr) (void)sscanf(text, "%d %15s %15s %d %4095s", &p.at, often, kind, &p.error, p.folder);
    p.forever = strcmp(often, "forever") == 0;
    p.is_short = strcmp(kind, "short") == 0;
    return p;
  }();
  return plan;
}

template <class Function>
Function real(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

bool below_folder(const char* path) {
  const std::size_t length = strlen(plan().folder);
  return length > 0 && strncmp(path, plan().folder, length) == 0;
}

bool is_watched(int file) {
  const std::lock_guard lock(mutex);
  return file >= 0 && file < kMostFiles && watched[static_cast<std::size_t>(file)];
}

void watch(int file, bool on) {
  const std::lock_guard lock(mutex);
  if (file < 0 || file >= kMostFiles) return;
  watched[static_cast<std::size_t>(file)] = on;
  written[static_cast<std::size_t>(file)] = false;
}

/// Forgets the file. True when something was written through it.
bool close_watched(int file) {
  const std::lock_guard lock(mutex);
  watched[static_cast<std::size_t>(file)] = false;
  return written[static_cast<std::size_t>(file)];
}

void keep_counts() {
  const char* path = getenv("SUPERTAC_FAULT_COUNT");
  if (path == nullptr) return;
  const int file = real<int (*)(const char*, int, ...)>("open")(path, O_WRONLY | O_CREAT, 0600);
  char text[32];
  const int length = snprintf(text, sizeof text, "%8d %8d", calls, grave);
  (void)!real<ssize_t (*)(int, const void*, std::size_t)>("write")(file, text,
                                                                   static_cast<std::size_t>(length));
  real<int (*)(int)>("close")(file);
}

enum class Call { other, write, clean_close };

/// Counts a call; true when it is to fail, errno then set.
bool hit(Call call = Call::other) {
  const std::lock_guard lock(mutex);
  ++calls;
  const bool now = calls == plan().at || (plan().forever && calls > plan().at);
  const bool fails = now && (!plan().is_short || call == Call::write);
  if (fails && !plan().is_short && call != Call::clean_close) ++grave;
  keep_counts();
  if (fails) errno = plan().error;
  return fails;
}

int open_file(const char* path, int flags, mode_t mode) {
  const bool ours = below_folder(path) && ((flags & O_ACCMODE) != O_RDONLY || (flags & O_DIRECTORY) != 0);
  if (ours && hit()) return -1;
  const int file = real<int (*)(const char*, int, ...)>("open64")(path, flags, mode);
  watch(file, ours);
  return file;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
  va_end(arguments);
  return open_file(path, flags, mode);
}

int open64(const char* path, int flags, ...) __attribute__((alias("open")));  // on 64 bits they are one

ssize_t write(int file, const void* bytes, std::size_t count) {
  if (is_watched(file)) {
    if (hit(Call::write)) {
      if (!plan().is_short) return -1;
      count = (count + 1) / 2;
    }
    const std::lock_guard lock(mutex);
    written[static_cast<std::size_t>(file)] = true;
  }
  return real<ssize_t (*)(int, const void*, std::size_t)>("write")(file, bytes, count);
}

int fsync(int file) { return is_watched(file) && hit() ? -1 : real<int (*)(int)>("fsync")(file); }

int fdatasync(int file) { return is_watched(file) && hit() ? -1 : real<int (*)(int)>("fdatasync")(file); }

int close(int file) {
  if (!is_watched(file)) return real<int (*)(int)>("close")(file);
  const bool clean = !close_watched(file);
  (void)real<int (*)(int)>("close")(file);  // the descriptor is gone in any case
  return hit(clean ? Call::clean_close : Call::other) ? -1 : 0;
}

int rename(const char* from, const char* to) {
  return below_folder(to) && hit() ? -1 : real<int (*)(const char*, const char*)>("rename")(from, to);
}

}  // extern "C"
