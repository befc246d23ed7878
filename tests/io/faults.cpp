#include "tests/io/faults.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cstdarg>

using supertac::FaultInjection;

// --wrap=open leads open() to __wrap_open(), and __real_open() to the system's.
extern "C" {
int __real_open(const char* path, int flags, ...);
int __real_fstat(int file, struct stat* status);
ssize_t __real_read(int file, void* bytes, std::size_t count);
ssize_t __real_pread(int file, void* bytes, std::size_t count, off_t offset);
ssize_t __real_write(int file, const void* bytes, std::size_t count);
int __real_fsync(int file);
int __real_close(int file);
int __real_rename(const char* from, const char* to);
int __real_renameat2(int folder, const char* from, int other, const char* to, unsigned flags);

int __wrap_open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return FaultInjection::hit("open") ? -1 : __real_open(path, flags, mode);
}
int __wrap_fstat(int file, struct stat* status) {
  return FaultInjection::hit("fstat") ? -1 : __real_fstat(file, status);
}
ssize_t __wrap_read(int file, void* bytes, std::size_t count) {
  return FaultInjection::transfer("read", __real_read, file, bytes, count);
}
ssize_t __wrap_pread(int file, void* bytes, std::size_t count, off_t offset) {
  return FaultInjection::transfer("pread", __real_pread, file, bytes, count, offset);
}
ssize_t __wrap_write(int file, const void* bytes, std::size_t count) {
  return FaultInjection::transfer("write", __real_write, file, bytes, count);
}
int __wrap_fsync(int file) { return FaultInjection::hit("fsync") ? -1 : __real_fsync(file); }
int __wrap_close(int file) {
  const int result = __real_close(file);  // the descriptor is gone in any case
  return FaultInjection::hit("close") ? -1 : result;
}
int __wrap_rename(const char* from, const char* to) {
  return FaultInjection::hit("rename") ? -1 : __real_rename(from, to);
}
int __wrap_renameat2(int folder, const char* from, int other, const char* to, unsigned flags) {
  return FaultInjection::hit("rename") ? -1 : __real_renameat2(folder, from, other, to, flags);
}
}
