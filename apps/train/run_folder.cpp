#include "apps/train/run_folder.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include "apps/web/pages.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr const char* kHeader =
    "time_s,step,total,reconstruction,kld,l2,ssim,gradient_norm,learning_rate,test_ssim,test_psnr_db\n";
constexpr std::uint64_t kMaxLogBytes = 64 << 20;

std::string csv(const LogLine& line) {
  std::string out = format(line.time_s, 3) + "," + std::to_string(line.step);
  for (const double v : {line.total, line.reconstruction, line.kld, line.l2, line.ssim, line.gradient_norm,
                         line.learning_rate})
    out += "," + format(v);
  out += "," + (line.test_ssim ? format(*line.test_ssim, 5) : "");
  out += "," + (line.test_psnr_db ? format(*line.test_psnr_db, 3) : "");
  return out + "\n";
}

// The log up to a step. A damaged line (the last one of a killed run) is left out.
std::string read_log(const std::string& path, std::int64_t last_step) {
  constexpr std::size_t kColumns = 11;
  std::string log = kHeader;
  if (!std::filesystem::exists(path)) return log;
  std::istringstream in(read_text_file(path, kMaxLogBytes));
  std::string line;
  std::getline(in, line);  // the header
  while (std::getline(in, line)) {
    const std::vector<std::string> fields = comma_list(line + ",");
    const auto step = fields.size() == kColumns ? parse_int(fields[1]) : std::nullopt;
    if (step && *step <= last_step) log += line + "\n";
  }
  return log;
}

}  // namespace

std::string RunFolder::folder_of(const std::string& model_file) {
  return std::filesystem::path(model_file).replace_extension(".run").string();
}

RunFolder::RunFolder(const std::string& model_file, bool force, std::optional<std::int64_t> resumed_step)
    : path_(folder_of(model_file)) {
  if (path_ == model_file)
    throw FileError(path_,
                    "a name that ends in .run is that of the folder beside a model; choose another --out");
  const bool exists = std::filesystem::exists(path_);
  if (exists && !force && !resumed_step) {
    throw FileError(path_, "is the folder of an earlier run; " +
                               (std::filesystem::exists(checkpoint_path())
                                    ? "resume it with --resume " + checkpoint_path() + ", "
                                    : std::string()) +
                               "overwrite it with --force, or choose another --out");
  }
  std::error_code error;
  std::filesystem::create_directories(path_, error);
  if (error) throw FileError(path_, "cannot create the folder: " + error.message());
  lock_ = std::make_unique<FolderLock>(path_);
  log_ = resumed_step ? read_log(path_ + "/log.csv", *resumed_step) : kHeader;
  write_file(path_ + "/log.csv", log_);
}

double RunFolder::seconds() const {
  const std::size_t last_line = log_.rfind('\n', log_.size() - 2) + 1;
  return parse_double(log_.substr(last_line, log_.find(',', last_line) - last_line)).value_or(0);
}

void RunFolder::write_settings(const nlohmann::ordered_json& settings) {
  write_file(path_ + "/settings.json", settings.dump(2) + "\n");
}

bool RunFolder::log(const LogLine& line) {
  log_ += csv(line);
  if (log_broken_) return true;
  std::ofstream out(path_ + "/log.csv", std::ios::app);
  out << csv(line) << std::flush;
  log_broken_ = !out;
  return !log_broken_;
}

void RunFolder::write_report() const {
  write_file(path_ + "/report.html", result_page({{"title", "SuperTac training"}, {"log", log_}}));
}

}  // namespace supertac
