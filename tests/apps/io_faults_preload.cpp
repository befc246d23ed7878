// Preloaded into a program (LD_PRELOAD): the N-th open, write, fsync, close or rename of a file below a
// folder fails. SUPERTAC_FAULT = "N once|forever error|short ERRNO FOLDER"; the number of calls seen is kept
// in the file SUPERTAC_FAULT_COUNT, so that the caller knows when N was beyond the last.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <atomic>
#include <bitset>
#include <mutex>

namespace {

struct Plan {
  int at = 0, error = 0;
  bool forever = false, is_short = false;
  char folder[4096] = {};
};

constexpr int kMostFiles = 1024;
std::bitset<kMostFiles> watched;
std::mutex mutex;
int calls = 0;

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
  const size_t length = strlen(plan().folder);
  return length > 0 && strncmp(path, plan().folder, length) == 0;
}

bool is_watched(int file) {
  const std::lock_guard lock(mutex);
  return file >= 0 && file < kMostFiles && watched[static_cast<size_t>(file)];
}

void watch(int file, bool on) {
  const std::lock_guard lock(mutex);
  if (file >= 0 && file < kMostFiles) watched[static_cast<size_t>(file)] = on;
}

/// Counts a call; true when it is to fail, errno then set.
bool hit(bool can_be_short = false) {
  const std::lock_guard lock(mutex);
  ++calls;
  if (const char* path = getenv("SUPERTAC_FAULT_COUNT")) {
    const int file = real<int (*)(const char*, int, ...)>("open")(path, O_WRONLY | O_CREAT, 0600);
    char text[16];
    const int length = snprintf(text, sizeof text, "%8d", calls);
    (void)!real<ssize_t (*)(int, const void*, size_t)>("write")(file, text, static_cast<size_t>(length));
    real<int (*)(int)>("close")(file);
  }
  const bool now = calls == plan().at || (plan().forever && calls > plan().at);
  if (!now || (plan().is_short && !can_be_short)) return false;
  errno = plan().error;
  return true;
}

int open_file(const char* name, const char* path, int flags, mode_t mode) {
  const bool ours = below_folder(path) && ((flags & O_ACCMODE) != O_RDONLY || (flags & O_DIRECTORY) != 0);
  if (ours && hit()) return -1;
  const int file = real<int (*)(const char*, int, ...)>(name)(path, flags, mode);
  watch(file, ours);
  return file;
}

mode_t mode_of(va_list arguments, int flags) {
  return (flags & O_CREAT) != 0 ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(arguments, flags);
  va_end(arguments);
  return open_file("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(arguments, flags);
  va_end(arguments);
  return open_file("open64", path, flags, mode);
}

ssize_t write(int file, const void* bytes, size_t count) {
  if (is_watched(file) && hit(true)) {
    if (!plan().is_short) return -1;
    count = (count + 1) / 2;
  }
  return real<ssize_t (*)(int, const void*, size_t)>("write")(file, bytes, count);
}

int fsync(int file) { return is_watched(file) && hit() ? -1 : real<int (*)(int)>("fsync")(file); }

int fdatasync(int file) { return is_watched(file) && hit() ? -1 : real<int (*)(int)>("fdatasync")(file); }

int close(int file) {
  const bool ours = is_watched(file);
  watch(file, false);
  const int result = real<int (*)(int)>("close")(file);  // the descriptor is gone in any case
  return ours && hit() ? -1 : result;
}

int rename(const char* from, const char* to) {
  return below_folder(to) && hit() ? -1 : real<int (*)(const char*, const char*)>("rename")(from, to);
}

}  // extern "C"
