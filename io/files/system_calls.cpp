#include "io/files/system_calls.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>

namespace supertac {
namespace {

int rename_new(const char* from, const char* to) {
  if (::renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return -1;
  // File systems without it (NFS, some of FUSE): a second name for a file. A folder has one name only, but
  // never takes the place of one that holds anything.
  if (::link(from, to) == 0) return ::unlink(from);
  if (errno == EEXIST) return -1;
  struct stat status {};
  if (::lstat(to, &status) == 0) return errno = EEXIST, -1;
  return std::rename(from, to);
}

}  // namespace

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
      .rename_new = rename_new,
      .unlink = ::unlink,
  };
}

bool sync_folder_of(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path();
  const int flags = O_RDONLY | O_DIRECTORY | O_CLOEXEC;
  const int folder =
      retry([&] { return system_calls().open(parent.empty() ? "." : parent.c_str(), flags, 0); });
  if (folder < 0) return false;
  const int result = retry([&] { return system_calls().fsync(folder); });
  // EINVAL: a file system that has nothing to sync for a folder.
  const bool synced = result == 0 || errno == EINVAL;
  const int error = errno;
  (void)system_calls().close(folder);  // nothing was written through it
  errno = error;
  return synced;
}

SystemCalls& system_calls() {
  static SystemCalls calls = real_system_calls();
  return calls;
}

}  // namespace supertac
