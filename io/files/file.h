// Whole files, read with a limit and written atomically, files without a name for numbers that may be more
// than memory holds, and folders that one program at a time fills.
#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace supertac {

/// A file could not be read or written, or holds something else than expected. what() is one line,
/// "<path>: <what was wrong, expected, found, what to do>".
class FileError : public std::runtime_error {
 public:
  FileError(const std::string& path, const std::string& problem)
      : std::runtime_error(path + ": " + problem) {}
};

/// A regular file opened for reading, front to back. Reads are buffered by the caller's span, never mapped:
/// a mapped file that another program shortens would end the process with SIGBUS.
class FileReader {
 public:
  /// Throws FileError when the file cannot be opened or is no regular file (a directory, a pipe, a device).
  explicit FileReader(const std::string& path);
  ~FileReader();
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;

  /// Bytes in the file when it was opened.
  std::uint64_t size() const { return size_; }
  /// Fills all of `bytes`. Throws FileError on an I/O error, or when the file ends first.
  void read(std::span<std::byte> bytes);

 private:
  std::string path_;
  int file_ = -1;
  std::uint64_t size_ = 0;
  std::uint64_t position_ = 0;
};

/// The whole file. Throws FileError when it cannot be read or is larger than `max_bytes`; the size is checked
/// before anything is allocated.
std::vector<std::byte> read_file(const std::string& path, std::uint64_t max_bytes);
std::string read_text_file(const std::string& path, std::uint64_t max_bytes);

/// The name that something finished is to get.
struct OutputPath {
  // Converts: most files are a program's own, and are replaced.
  OutputPath(std::string name) : path(std::move(name)) {}
  OutputPath(const char* name) : path(name) {}
  OutputPath(std::string name, std::function<void(const std::string& line)> taken)
      : path(std::move(name)), when_taken(std::move(taken)) {}

  std::string path;
  /// Empty: what has this name is replaced. Otherwise it stays, even if it appeared only while the program
  /// worked; what was finished then gets another name, and this is called with a line that says so.
  std::function<void(const std::string& line)> when_taken;
};

/// Renames a finished file or folder, on the same file system, to `output`, or to NAME-2, NAME-3, ... before
/// the extension where that name is taken. Returns the name. Throws FileError; what was finished is then
/// still where it was, unless the message says that only the sync of the directory failed.
std::string publish(const std::string& finished, const OutputPath& output);

/// A file that appears under its name complete or not at all: written to a temporary name in the same
/// directory (O_EXCL), then commit() does fsync, close, publish() and fsync of the directory. An existing
/// file stays as it is until then. A symbolic link to be replaced stays; the file it points at is replaced. A
/// temporary that a killed process left of the same file is removed when the file is next written.
class AtomicFile {
 public:
  /// Throws FileError: no such directory, not writable, or `path` is something else than a regular file.
  explicit AtomicFile(const OutputPath& output);
  /// Removes the temporary when commit() has not succeeded.
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends. Throws FileError; the old file is then intact, and the temporary goes with this object. After
  /// commit() both throw std::invalid_argument.
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text);
  /// Throws FileError as write() does. A failed fsync is final: the kernel may have dropped the pages, and a
  /// second fsync would report success. Only when the last step fails, the sync of the directory, the new
  /// file is already in place, complete, and may yet be lost in a power cut; the message says so.
  void commit();

 private:
  void open_temporary();

  OutputPath output_;
  std::string path_;       // of output_, followed to the end where it is a link
  std::string temporary_;  // empty: there is none (yet, or any more)
  int file_ = -1;
};

/// AtomicFile in one call.
void write_file(const OutputPath& output, std::span<const std::byte> bytes);
void write_file(const OutputPath& output, std::string_view text);

/// Throws FileError when `path` exists and `force` is false: nothing is overwritten without --force.
void refuse_existing(const std::string& path, bool force);

/// False when no process has this number any more.
bool is_running(std::uint64_t process);

/// Creates the directory and its parents where they are missing. Throws FileError.
void make_directories(const std::string& path);

/// Holds a folder (flock on the folder itself: nothing is left behind, and a killed program holds nothing).
/// Several locks of one folder in one process are one.
class FolderLock {
 public:
  /// `folder` exists. Throws FileError when another process holds it. File systems without locks lock
  /// nothing.
  explicit FolderLock(const std::string& folder);

 private:
  std::shared_ptr<const int> held_;
};

/// A file without a name, in TMPDIR or else in /var/tmp: numbers are appended once and read anywhere, by many
/// threads at once. The system keeps of it in memory what there is room for, and it is gone with the process,
/// however that ends: nobody else can read, shorten or forge it. Reads go into the caller's span and are
/// never mapped, for the reason that FileReader gives.
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

/// fsync of the folder that holds `path`, so that a power cut does not lose a new name. False with errno set.
bool sync_folder_of(const std::string& path);

/// Writes all bytes to a descriptor. False with errno set.
bool write_all(int file, std::span<const std::byte> bytes);

/// Calls again as long as a signal interrupts.
auto retry(const auto& call) {
  for (;;) {
    const auto result = call();
    if (result >= 0 || errno != EINTR) return result;
  }
}

}  // namespace supertac
