// Numbers that may be more than memory holds.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace supertac {

/// A file without a name, in TMPDIR or else in /var/tmp: numbers are appended once and read anywhere, by many
/// threads at once. The system keeps of it in memory what there is room for, and it is gone with the process,
/// however that ends: nobody else can read, shorten or forge it. Reads go into the caller's span and are
/// never mapped, for the reason that FileReader (io/files/file.h) gives.
class ScratchFile {
 public:
  /// Throws FileError when no file can be made there.
  ScratchFile();
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// Appends the numbers and returns the place of the first. Throws FileError, for example when the disk is
  /// full.
  std::uint64_t append(std::span<const float> numbers);
  /// Fills all of `numbers` with those from `place` on. Throws FileError on an I/O error.
  void read(std::uint64_t place, std::span<float> numbers) const;

 private:
  std::string folder_;
  int file_ = -1;
  std::uint64_t count_ = 0;
};

}  // namespace supertac
