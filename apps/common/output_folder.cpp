#include "apps/common/output_folder.h"

#include <filesystem>

#include "apps/common/provenance.h"
#include "io/file.h"

namespace supertac {

namespace fs = std::filesystem;

OutputFolder::OutputFolder(const std::string& path, bool force) : path_(path), force_(force) {
  std::error_code error;
  for (fs::path folder = fs::absolute(path, error); !folder.empty() && !fs::exists(folder, error);
       folder = folder.parent_path()) {
    folders_.push_back(folder.string());
    if (folder == folder.parent_path()) break;
  }
  try {
    make_directories(path);
    lock_ = std::make_unique<FolderLock>(path);
    // Opens a temporary in the folder and removes it: the permission to write, tried.
    AtomicFile((fs::path(path) / ".writable").string());
  } catch (...) {
    remove_made();
    throw;
  }
}

OutputFolder::~OutputFolder() {
  if (!kept_) remove_made();
}

void OutputFolder::remove_made() {
  std::error_code ignored;
  for (const std::string& file : made_) fs::remove(file, ignored);
  for (const std::string& folder : folders_) fs::remove(folder, ignored);  // only when empty
}

void OutputFolder::keep() {
  constexpr std::uint64_t kMostBytes = 16 << 20;
  const std::string file = (fs::path(path_) / kFolderProvenance).string();
  std::error_code error;
  std::string lines = fs::exists(file, error) ? read_text_file(file, kMostBytes) : "";
  nlohmann::ordered_json line = full_provenance();
  line["files"] = added_;
  write_file(file, lines + line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  kept_ = true;
}

std::string OutputFolder::add(const std::string& name) {
  const std::string file = (fs::path(path_) / name).string();
  refuse_existing(file, force_);
  ++added_;
  std::error_code error;
  if (!fs::exists(fs::symlink_status(file, error))) made_.push_back(file);
  return file;
}

}  // namespace supertac
