// A folder of results appears whole or not at all.
#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "io/files/file.h"

namespace supertac {

/// A folder that a program fills with several files, all or none. They are written to a hidden folder made
/// for them, beside the one that is to appear or, where that is there, in it, and get their names when keep()
/// is called: not even a killed program leaves a part of them. What it does leave, the next one removes.
class OutputFolder {
 public:
  /// Creates the hidden folder. Throws FileError when it cannot, or when another program fills the same
  /// folder, so that a program finds out before it works.
  explicit OutputFolder(OutputPath output);
  /// Removes everything unless keep() has been called.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where the files are written until keep().
  std::string path() const { return hidden_.string(); }
  /// Path of a file to be written. Throws FileError when it exists and is not to be replaced.
  std::string add(const std::string& name);
  /// The folder appears, or the files in it. Where that name, or that of a file added, was taken meanwhile,
  /// OutputPath::when_taken holds. Of a file that was not added, one with the same bytes may be there
  /// already. The folder's provenance.jsonl gains a line: what full_provenance() says, and how many files it
  /// was. Throws FileError; nothing is then lost that was made. Throws Interrupted after a signal, unless
  /// what was made could not be made again.
  void keep(bool despite_signals = false);

 private:
  void make_hidden();
  void check_others() const;
  void move_files() const;
  void remove_made() const;

  OutputPath output_;
  std::filesystem::path final_, hidden_;
  bool was_there_;
  std::unique_ptr<FolderLock> final_lock_, hidden_lock_;
  bool kept_ = false;
  std::set<std::string> added_;
  std::vector<std::filesystem::path> parents_;  // that were made, innermost first
};

}  // namespace supertac
