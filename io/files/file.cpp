#include "io/files/file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <utility>

#include "io/numbers/numbers.h"

namespace supertac {
namespace {

const char* advice(int error) {
  switch (error) {
    case ENOENT:
      return "; check the name";
    case EACCES:
    case EPERM:
    case EROFS:
      return "; check the permissions or choose another place";
    case ENOSPC:
    case EDQUOT:
      return "; free some space or choose another place";
    case EIO:
      return "; check the disk";
    default:
      return "";
  }
}

[[noreturn]] void fail(const std::string& path, const std::string& action, int error) {
  throw FileError(path, "cannot " + action + ": " + std::strerror(error) + advice(error));
}

// Not retried: on Linux the descriptor is gone even after EINTR, and may by now be somebody else's.
void close_quietly(int& file) {
  if (file >= 0) ::close(file);
  file = -1;
}

std::string directory_of(const std::string& path) {
  const auto parent = std::filesystem::path(path).parent_path();
  return parent.empty() ? "." : parent.string();
}

// Where the bytes go: the target of a symbolic link, otherwise the path itself.
std::string final_path(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_symlink(path, error)) return path;
  const auto target = std::filesystem::canonical(path, error);
  return error ? path : target.string();
}

constexpr std::string_view kTemporary = ".tmp-";  // <file>.tmp-<process>-<number>

// What writers of this file left that were ended by kill -9 or a power cut. Failures do not matter here.
void remove_leftovers(const std::string& path) {
  const std::string prefix = std::filesystem::path(path).filename().string() + std::string(kTemporary);
  std::error_code error;
  std::filesystem::directory_iterator entry(directory_of(path), error);
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(prefix)) continue;
    const auto process =
        parse_uint(name.substr(prefix.size(), name.find('-', prefix.size()) - prefix.size()));
    if (process && !is_running(*process)) ::unlink(entry->path().c_str());
  }
}

// Fails with EEXIST where there is something of the new name.
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

// publish() without the sync.
std::string rename_to(const std::string& finished, const OutputPath& output) {
  if (!output.when_taken) {
    if (std::rename(finished.c_str(), output.path.c_str()) != 0)
      fail(output.path, "rename into place", errno);
    return output.path;
  }
  const std::filesystem::path wished(output.path);
  for (int number = 1; number <= 1000; ++number) {
    auto name = wished;
    if (number > 1)
      name.replace_filename(wished.stem().string() + "-" + std::to_string(number) +
                            wished.extension().string());
    if (rename_new(finished.c_str(), name.c_str()) == 0) {
      if (number > 1)
        output.when_taken(output.path + ": appeared meanwhile and is not replaced; what was made is " +
                          name.string());
      return name.string();
    }
    if (errno != EEXIST) fail(output.path, "rename into place", errno);
  }
  throw FileError(output.path, "is taken, and so are 999 names after it; what was made is " + finished);
}

void sync_name(const std::string& name) {
  if (!sync_folder_of(name))
    fail(name, "sync the directory (it is written, a power cut may yet lose it)", errno);
}

}  // namespace

bool sync_folder_of(const std::string& path) {
  int folder = retry([&] { return ::open(directory_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); });
  if (folder < 0) return false;
  // EINVAL: a file system that has nothing to sync for a folder.
  const bool synced = retry([&] { return ::fsync(folder); }) == 0 || errno == EINVAL;
  const int error = errno;
  close_quietly(folder);  // nothing was written through it
  errno = error;
  return synced;
}

bool write_all(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = retry([&] { return ::write(file, bytes.data(), bytes.size()); });
    if (count == 0) errno = ENOSPC;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

bool is_running(std::uint64_t process) {
  const auto id = static_cast<pid_t>(process);
  return static_cast<std::uint64_t>(id) != process || id < 1 || ::kill(id, 0) == 0 || errno != ESRCH;
}

FileReader::FileReader(const std::string& path) : path_(path) {
  // O_NONBLOCK: opening a pipe must not wait for a writer.
  const int flags = O_RDONLY | O_CLOEXEC | O_NONBLOCK;
  file_ = retry([&] { return ::open(path.c_str(), flags); });
  if (file_ < 0) fail(path, "open the file", errno);
  struct stat status {};
  if (::fstat(file_, &status) != 0) {
    const int error = errno;
    close_quietly(file_);
    fail(path, "look at the file", error);
  }
  if (!S_ISREG(status.st_mode)) {
    close_quietly(file_);
    throw FileError(path, S_ISDIR(status.st_mode) ? "is a directory, expected a file; name a file in it"
                                                  : "is not a regular file; copy it to one first");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

FileReader::~FileReader() { close_quietly(file_); }

void FileReader::read(std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = retry([&] { return ::read(file_, bytes.data(), bytes.size()); });
    if (count < 0) fail(path_, "read", errno);
    if (count == 0) {
      throw FileError(path_, "ends after " + std::to_string(position_) + " bytes, expected " +
                                 std::to_string(position_ + bytes.size()) +
                                 "; it is cut short or was shortened while it was read");
    }
    position_ += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

std::vector<std::byte> read_file(const std::string& path, std::uint64_t max_bytes) {
  FileReader reader(path);
  if (reader.size() > max_bytes) {
    throw FileError(path, "has " + std::to_string(reader.size()) + " bytes, expected at most " +
                              std::to_string(max_bytes) + "; is it the right file?");
  }
  std::vector<std::byte> bytes(reader.size());
  reader.read(bytes);
  return bytes;
}

std::string read_text_file(const std::string& path, std::uint64_t max_bytes) {
  const auto bytes = read_file(path, max_bytes);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string publish(const std::string& finished, const OutputPath& output) {
  const std::string name = rename_to(finished, output);
  sync_name(name);
  return name;
}

AtomicFile::AtomicFile(const OutputPath& output)
    : output_(output), path_(output.when_taken ? output.path : final_path(output.path)) {
  std::error_code error;
  const auto status = std::filesystem::status(path_, error);
  if (!output_.when_taken && std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    throw FileError(path_, "exists and is not a regular file; choose another name");
  }
  remove_leftovers(path_);
  open_temporary();
}

void AtomicFile::open_temporary() {
  static std::atomic<unsigned> next{0};
  const std::string prefix = path_ + std::string(kTemporary) + std::to_string(::getpid()) + "-";
  for (int attempt = 0; attempt < 100; ++attempt) {
    const std::string name = prefix + std::to_string(next++);
    const int flags = O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC;
    file_ = retry([&] { return ::open(name.c_str(), flags, 0666); });
    if (file_ >= 0) {
      temporary_ = name;
      return;
    }
    if (errno != EEXIST) fail(path_, "create a file in " + directory_of(path_), errno);
  }
  throw FileError(path_, "100 temporary files " + prefix + "* are in the way; remove them");
}

AtomicFile::~AtomicFile() {
  close_quietly(file_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::span<const std::byte> bytes) {
  if (file_ < 0) throw std::invalid_argument("AtomicFile: write after commit (" + path_ + ")");
  if (!write_all(file_, bytes)) fail(path_, "write", errno);
}

void AtomicFile::write(std::string_view text) { write(std::as_bytes(std::span(text))); }

void AtomicFile::commit() {
  if (file_ < 0) throw std::invalid_argument("AtomicFile: commit twice (" + path_ + ")");
  if (retry([&] { return ::fsync(file_); }) != 0) fail(path_, "sync to disk", errno);
  const int closed = ::close(std::exchange(file_, -1));
  if (closed != 0 && errno != EINTR) fail(path_, "close", errno);
  const std::string name = rename_to(temporary_, {path_, output_.when_taken});
  temporary_.clear();
  sync_name(name);
}

void write_file(const OutputPath& output, std::span<const std::byte> bytes) {
  AtomicFile file(output);
  file.write(bytes);
  file.commit();
}

void write_file(const OutputPath& output, std::string_view text) {
  write_file(output, std::as_bytes(std::span(text)));
}

void refuse_existing(const std::string& path, bool force) {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(path, error);
  if (!force && std::filesystem::exists(status)) {
    throw FileError(path, "exists already; choose another name or pass --force to replace it");
  }
}

void make_directories(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error && std::filesystem::is_directory(path, error)) return;
  fail(path, "create the directory", error ? error.value() : ENOTDIR);
}

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

namespace {

[[noreturn]] void no_room(const std::string& folder, const char* what, int error) {
  throw FileError(folder, std::string("cannot ") + what + " a temporary file there: " + std::strerror(error) +
                              "; set TMPDIR to a folder on a disk with room");
}

}  // namespace

ScratchFile::ScratchFile() {
  const char* chosen = std::getenv("TMPDIR");
  folder_ = chosen != nullptr && *chosen != '\0' ? chosen : "/var/tmp";
  std::string name = folder_ + "/.supertac-XXXXXX";
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) no_room(folder_, "make", errno);
  ::unlink(name.c_str());
}

ScratchFile::~ScratchFile() { ::close(file_); }

std::uint64_t ScratchFile::append(std::span<const float> numbers) {
  if (!write_all(file_, std::as_bytes(numbers))) no_room(folder_, "write", errno);
  const std::uint64_t place = count_;
  count_ += numbers.size();
  return place;
}

void ScratchFile::read(std::uint64_t place, std::span<float> numbers) const {
  std::uint64_t offset = place * sizeof(float);
  for (auto bytes = std::as_writable_bytes(numbers); !bytes.empty();) {
    const ssize_t count =
        retry([&] { return ::pread(file_, bytes.data(), bytes.size(), static_cast<off_t>(offset)); });
    if (count <= 0) no_room(folder_, "read", count < 0 ? errno : EIO);
    offset += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

}  // namespace supertac
