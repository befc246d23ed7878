#include "apps/common/output/outputs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

// Device and inode where there is something; otherwise those of the folder, and the name in it.
std::string identity_of(const std::string& path) {
  struct stat status {};
  const auto text = [&status] { return std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino); };
  if (::stat(path.c_str(), &status) == 0) return text();
  const fs::path whole(path);
  const fs::path folder = whole.has_parent_path() ? whole.parent_path() : fs::path(".");
  if (::stat(folder.c_str(), &status) == 0) return text() + "/" + whole.filename().string();
  return fs::path(path).lexically_normal().string();
}

bool is_folder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

// An existing file of an input folder that an output would replace.
bool lies_in(const std::string& file, const std::string& folder) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || !is_folder(folder)) return false;
  const fs::path inside = fs::relative(file, folder, error);
  return !error && !inside.empty() && *inside.begin() != "..";
}

void check_folder(const std::string& path) {
  std::error_code error;
  fs::path there = fs::absolute(path, error);
  while (!fs::exists(fs::symlink_status(there, error)) && there.has_parent_path() &&
         there != there.parent_path()) {
    if (error && error.value() != ENOENT)
      throw FileError(path, "cannot be made: " + error.message() + "; choose another name");
    there = there.parent_path();
  }
  if (!is_folder(there.string()))
    throw FileError(path, there.string() + " is not a folder, expected one; choose another place");
  if (::access(there.c_str(), W_OK | X_OK) != 0)
    throw FileError(path, "the folder " + there.string() + " cannot be written; choose another place");
}

}  // namespace

void check_outputs(const Arguments& arguments) {
  const std::vector<NamedPath> paths = arguments.paths();
  for (const NamedPath& output : paths) {
    if (!output.is_output) continue;
    for (const NamedPath& other : paths) {
      if (&other == &output) continue;
      if (identity_of(output.path) != identity_of(other.path) &&
          (other.is_output || !lies_in(output.path, other.path)))
        continue;
      throw UsageError("--" + output.option + ": " + in_quotes(output.path) + " would overwrite " +
                       (other.is_output ? "the output of --" : "the input of --") + other.option +
                       "; choose another name");
    }
  }
  for (const NamedPath& output : paths) {
    if (!output.is_output) continue;
    if (output.is_folder) {
      check_folder(output.path);
    } else {
      refuse_existing(output.path, arguments.force());
      // Opens a temporary beside it and removes it: the name and the permission, tried.
      const AtomicFile trial(output.path);
    }
  }
}

void open_standard_descriptors() {
  for (int file = 0; file <= 2; ++file) {
    // The lowest number that is free, which is this one.
    if (::fcntl(file, F_GETFD) < 0 && errno == EBADF) (void)::open("/dev/null", O_RDWR);
  }
}

}  // namespace supertac
