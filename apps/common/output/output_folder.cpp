#include "apps/common/output/output_folder.h"

#include <filesystem>

#include "apps/common/output/provenance.h"
#include "io/files/file.h"

namespace supertac {

namespace fs = std::filesystem;

namespace {

// Beside the folder that is to appear; what a killed program left there is written over.
std::string hidden_name_of(const std::string& path) {
  constexpr std::size_t kMostLetters = 200;
  fs::path whole = fs::absolute(path).lexically_normal();
  if (!whole.has_filename()) whole = whole.parent_path();
  return whole.parent_path() / ("." + whole.filename().string().substr(0, kMostLetters) + ".unfinished");
}

}  // namespace

OutputFolder::OutputFolder(const std::string& path, bool force) : path_(path), force_(force) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(path, error))) path_ = hidden_name_of(path), final_ = path;
  for (fs::path folder = fs::absolute(path_, error); !folder.empty() && !fs::exists(folder, error);
       folder = folder.parent_path()) {
    folders_.push_back(folder.string());
    if (folder == folder.parent_path()) break;
  }
  try {
    make_directories(path_);
    lock_ = std::make_unique<FolderLock>(path_);
    if (!final_.empty())
      for (const auto& left : fs::directory_iterator(path_)) fs::remove_all(left.path());
    // Opens a temporary in the folder and removes it: the permission to write, tried.
    AtomicFile((fs::path(path_) / ".writable").string());
  } catch (const FileError& failure) {
    remove_made();
    if (final_.empty()) throw;
    const std::string text = failure.what();  // of the hidden folder, which nobody asked for
    throw FileError(path, text.starts_with(path_ + ": ") ? text.substr(path_.size() + 2) : text);
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
  if (!final_.empty() && lock_) fs::remove_all(path_, ignored);
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
  if (!final_.empty()) fs::rename(path_, final_, error);
  if (!final_.empty() && error)
    throw FileError(final_, "cannot appear: " + error.message() + "; choose another name");
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
