#include "io/files/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <map>
#include <mutex>
#include <utility>

#include "io/files/file.h"

namespace supertac {

FolderLock::FolderLock(const std::string& folder) {
  static std::mutex mutex;
  static std::map<std::pair<dev_t, ino_t>, std::weak_ptr<const int>> all;
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return;  // whoever writes there will say why not
  const auto close = [](const int* held) {
    ::close(*held);
    delete held;
  };
  std::shared_ptr<const int> opened(new int(file), close);
  struct stat status {};
  if (::fstat(file, &status) != 0) return;
  const std::lock_guard lock(mutex);
  std::weak_ptr<const int>& known = all[{status.st_dev, status.st_ino}];
  held_ = known.lock();
  if (held_) return;
  if (::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw FileError(folder, "another program is writing there; wait for its end, or choose another folder");
  held_ = std::move(opened);
  known = held_;
}

}  // namespace supertac
