// A file of which any part is read at any time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace supertac {

/// A regular file opened for reading anywhere, by many threads at once. Reads are buffered by the caller's
/// span, never mapped, for the reason that FileReader (io/files/file.h) gives.
class PositionedFile {
 public:
  /// Throws FileError when the file cannot be opened.
  explicit PositionedFile(std::string path);
  ~PositionedFile();
  PositionedFile(const PositionedFile&) = delete;
  PositionedFile& operator=(const PositionedFile&) = delete;

  /// Fills all of `bytes` from `offset` on. Throws FileError on an I/O error, or when the file ends first.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// So much is read from there soon: the system may fetch it meanwhile.
  void will_read(std::uint64_t offset, std::uint64_t count) const;

 private:
  std::string path_;
  int file_ = -1;
};

}  // namespace supertac
