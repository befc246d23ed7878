#include "io/files/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "io/files/file.h"

namespace supertac {
namespace {

[[noreturn]] void fail(const std::string& folder, const char* what, int error) {
  throw FileError(folder, std::string("cannot ") + what + " a temporary file there: " + std::strerror(error) +
                              "; set TMPDIR to a folder on a disk with room");
}

std::string temporary_folder() {
  const char* chosen = std::getenv("TMPDIR");
  return chosen != nullptr && *chosen != '\0' ? chosen : "/var/tmp";
}

}  // namespace

ScratchFile::ScratchFile() : folder_(temporary_folder()) {
  std::string name = folder_ + "/.supertac-XXXXXX";
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) fail(folder_, "make", errno);
  ::unlink(name.c_str());
}

ScratchFile::~ScratchFile() { ::close(file_); }

std::uint64_t ScratchFile::append(std::span<const float> numbers) {
  for (auto bytes = std::as_bytes(numbers); !bytes.empty();) {
    const ssize_t count = retry([&] { return ::write(file_, bytes.data(), bytes.size()); });
    if (count <= 0) fail(folder_, "write", count < 0 ? errno : ENOSPC);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  const std::uint64_t place = count_;
  count_ += numbers.size();
  return place;
}

void ScratchFile::read(std::uint64_t place, std::span<float> numbers) const {
  std::uint64_t offset = place * sizeof(float);
  for (auto bytes = std::as_writable_bytes(numbers); !bytes.empty();) {
    const ssize_t count =
        retry([&] { return ::pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset)); });
    if (count <= 0) fail(folder_, "read", count < 0 ? errno : EIO);
    offset += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

}  // namespace supertac
