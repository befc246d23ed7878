// What a training run leaves behind besides the model: settings.json, log.csv, last.safetensors, report.html.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "io/files/file.h"
#include "models/training/train.h"

namespace supertac {

class RunFolder {
 public:
  /// The folder of a model file: "model.safetensors" -> "model.run". A new run refuses an existing one unless
  /// `force`; a resumed run keeps the log's lines up to `resumed_step`. Throws FileError.
  RunFolder(const std::string& model_file, bool force, std::optional<std::int64_t> resumed_step);

  std::string checkpoint_path() const { return path_ + "/last.safetensors"; }
  const std::string& path() const { return path_; }
  /// Seconds on the clock of the log at its last line; 0 when there is none.
  double seconds() const;

  void write_settings(const nlohmann::ordered_json& settings);
  /// Appends and flushes. When the disk refuses, returns false, once; later lines are then kept in memory
  /// only.
  bool log(const LogLine& line);
  /// A page with curves that needs no other file. Throws FileError.
  void write_report() const;
  static std::string folder_of(const std::string& model_file);

 private:
  std::string path_;
  std::unique_ptr<FolderLock> lock_;
  std::string log_;
  bool log_broken_ = false;
};

}  // namespace supertac
