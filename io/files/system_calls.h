// The few operating-system calls that reading and writing files needs, in one table, so that a test can make
// the N-th of them fail. Everything in io/ goes through this table and calls nothing else on a file.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cerrno>
#include <cstddef>
#include <string>

namespace supertac {

/// Same arguments, results and errno as the POSIX calls of these names.
struct SystemCalls {
  int (*open)(const char* path, int flags, mode_t mode);
  int (*fstat)(int file, struct stat* status);
  ssize_t (*read)(int file, void* bytes, std::size_t count);
  ssize_t (*pread)(int file, void* bytes, std::size_t count, off_t offset);
  ssize_t (*write)(int file, const void* bytes, std::size_t count);
  int (*fsync)(int file);
  int (*close)(int file);
  int (*rename)(const char* from, const char* to);
  /// Fails with EEXIST where there is something of the new name.
  int (*rename_new)(const char* from, const char* to);
  int (*unlink)(const char* path);
};

/// The real calls.
SystemCalls real_system_calls();

/// Calls again as long as a signal interrupts.
auto retry(const auto& call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

/// fsync of the folder that holds `path`, so that a power cut does not lose a new name. False with errno set.
bool sync_folder_of(const std::string& path);

/// The table in use. Replaced by tests only; not to be changed while another thread uses files.
SystemCalls& system_calls();

}  // namespace supertac
