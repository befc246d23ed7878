// Two programs must not fill one folder at a time.
#pragma once

#include <memory>
#include <string>

namespace supertac {

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

}  // namespace supertac
