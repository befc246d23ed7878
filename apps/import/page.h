// An import as one page that needs nothing from elsewhere.
#pragma once

#include <string>

#include "data/registration/text_folder.h"

namespace supertac {

/// What became of each pass, and its signals under the plate they were fitted to, with an axis in mm
/// (data/registration/registration_picture.h).
class ImportPage {
 public:
  void add(const ImportedPass& pass);
  std::string html(const std::string& command) const;

 private:
  std::string rows_, pictures_;
};

}  // namespace supertac
