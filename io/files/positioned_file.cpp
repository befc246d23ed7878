#include "io/files/positioned_file.h"

#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "io/files/file.h"
#include "io/files/system_calls.h"

namespace supertac {

PositionedFile::PositionedFile(std::string path) : path_(std::move(path)) {
  file_ = system_calls().open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK, 0);
  if (file_ < 0) throw FileError(path_, std::string("cannot open the file: ") + std::strerror(errno));
}

PositionedFile::~PositionedFile() { system_calls().close(file_); }

void PositionedFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = system_calls().pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0)
      throw FileError(path_, std::string("cannot read: ") + std::strerror(errno) + "; check the disk");
    if (count == 0)
      throw FileError(path_, "ends at byte " + std::to_string(offset) + ", expected " +
                                 std::to_string(bytes.size()) + " more; it was shortened while it was read");
    offset += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

// A hint: what comes of it does not matter.
void PositionedFile::will_read(std::uint64_t offset, std::uint64_t count) const {
  (void)::posix_fadvise(file_, static_cast<off_t>(offset), static_cast<off_t>(count), POSIX_FADV_WILLNEED);
}

}  // namespace supertac
