#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/files/folder_lock.h"

namespace supertac {

/// A folder that a program fills with several files, all or none, and holds alone meanwhile. A folder that is
/// not there yet is filled under a hidden name (.NAME.unfinished) and appears when keep() is called, so that
/// not even a killed program leaves a part of it; in one that is there, what was made is removed again unless
/// keep() is called. Files that were there before are never removed.
class OutputFolder {
 public:
  /// Creates the folder where it is missing.
  /// Throws FileError when it cannot be created or written to, so that a program finds out before it works.
  OutputFolder(const std::string& path, bool force);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where the files are written until keep().
  const std::string& path() const { return path_; }
  /// Path of a file to be written in the folder. Throws FileError when it exists and force is false.
  std::string add(const std::string& name);
  /// The folder's provenance.jsonl gains a line: what full_provenance() says, and how many files it was.
  /// Throws FileError, also when the folder cannot appear.
  void keep();

 private:
  void remove_made();

  std::string path_, final_;  // final_ is empty when the folder was there
  std::unique_ptr<FolderLock> lock_;
  bool force_;
  bool kept_ = false;
  std::size_t added_ = 0;
  std::vector<std::string> made_;     // files that were not there before
  std::vector<std::string> folders_;  // the same, innermost first
};

}  // namespace supertac
