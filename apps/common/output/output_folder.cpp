#include "apps/common/output/output_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "apps/common/output/provenance.h"
#include "apps/common/running/signals.h"
#include "io/numbers/numbers.h"

namespace supertac {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 30;

fs::path without_slash(const std::string& path) {
  const fs::path whole = fs::absolute(path).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

// Hidden folders are <prefix><process>-<number>, of this process or of others.
std::string prefix_of(const fs::path& final_path, bool was_there) {
  constexpr std::size_t kMostLetters = 200;
  return was_there ? ".unfinished-"
                   : "." + final_path.filename().string().substr(0, kMostLetters) + ".unfinished-";
}

// A hidden folder that somebody fills is locked. One that nobody does is removed if it is a folder of this
// user, whose process has ended: never what lies behind a link.
void look_at(const fs::path& hidden, const std::string& process) {
  struct stat status {};
  if (::lstat(hidden.c_str(), &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != ::geteuid())
    return;
  const FolderLock lock(hidden.string());
  std::error_code ignored;
  if (const auto id = parse_uint(process); id && !is_running(*id)) fs::remove_all(hidden, ignored);
}

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

}  // namespace

OutputFolder::OutputFolder(OutputPath output)
    : output_(std::move(output)), final_(without_slash(output_.path)), was_there_(is_there(final_)) {
  for (fs::path folder = was_there_ ? final_ : final_.parent_path(); !is_there(folder);
       folder = folder.parent_path())
    parents_.push_back(folder);
  try {
    make_directories(was_there_ ? output_.path : final_.parent_path().string());
    if (was_there_) final_lock_ = std::make_unique<FolderLock>(final_.string());
    make_hidden();
  } catch (...) {
    remove_made();
    throw;
  }
}

void OutputFolder::make_hidden() {
  const fs::path place = was_there_ ? final_ : final_.parent_path();
  const std::string prefix = prefix_of(final_, was_there_);
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(place, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    const std::string process = name.substr(prefix.size(), name.find('-', prefix.size()) - prefix.size());
    try {
      look_at(entry.path(), process);
    } catch (const FileError&) {  // of a lock: the hidden name is nobody's business
      throw FileError(output_.path,
                      "another program is writing there; wait for its end, or choose another folder");
    }
  }
  for (int number = 0;; ++number) {
    hidden_ = place / (prefix + std::to_string(::getpid()) + "-" + std::to_string(number));
    if (::mkdir(hidden_.c_str(), 0777) == 0) break;
    const int why = errno;
    if (why == EEXIST && number < 100) continue;
    hidden_.clear();
    throw FileError(output_.path,
                    std::string("cannot be written: ") + std::strerror(why) + "; choose another place");
  }
  hidden_lock_ = std::make_unique<FolderLock>(hidden_.string());
}

OutputFolder::~OutputFolder() {
  if (!kept_) remove_made();
}

void OutputFolder::remove_made() const {
  std::error_code ignored;
  if (!hidden_.empty()) fs::remove_all(hidden_, ignored);
  for (const fs::path& folder : parents_) fs::remove(folder, ignored);  // only when empty
}

void OutputFolder::keep(bool despite_signals) {
  if (!despite_signals) stop_if_interrupted();
  const fs::path before = final_ / kFolderProvenance;
  std::string lines = is_there(before) ? read_text_file(before.string(), kMostBytes) : "";
  nlohmann::ordered_json line = full_provenance();
  line["files"] = added_.size();
  lines += line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  write_file((hidden_ / kFolderProvenance).string(), lines);
  const bool in_it = was_there_ || (!output_.when_taken && fs::is_directory(final_));
  if (in_it) check_others();
  kept_ = true;  // from here on nothing that was made is removed, whatever happens
  try {
    if (in_it)
      move_files();
    else
      publish(hidden_.string(), {final_.string(), output_.when_taken});
  } catch (const FileError& error) {
    if (!is_there(hidden_)) throw;  // everything has its name
    // Under a name that the next program does not take for something unfinished.
    std::string name = hidden_.filename().string();
    if (const std::size_t at = name.rfind(".unfinished-"); at != std::string::npos)
      name.replace(at, 12, ".kept-");
    std::error_code failed;
    fs::rename(hidden_, hidden_.parent_path() / name, failed);
    if (!failed) hidden_ = hidden_.parent_path() / name;
    throw FileError(output_.path, std::string(error.what()) + "; what was made is in " + hidden_.string());
  }
}

void OutputFolder::check_others() const {
  for (const auto& entry : fs::directory_iterator(hidden_)) {
    const fs::path name = entry.path().filename(), place = final_ / name;
    if (added_.contains(name.string()) || name == kFolderProvenance || !is_there(place)) continue;
    if (read_file(entry.path().string(), kMostBytes) != read_file(place.string(), kMostBytes))
      throw FileError(place.string(),
                      "exists already and is another file; rename it, or choose another folder");
  }
}

void OutputFolder::move_files() const {
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(hidden_)) names.push_back(entry.path().filename());
  for (const fs::path& name : names) {
    const bool added = added_.contains(name.string());
    publish((hidden_ / name).string(), {(final_ / name).string(), added ? output_.when_taken : nullptr});
  }
  std::error_code ignored;
  fs::remove(hidden_, ignored);
}

std::string OutputFolder::add(const std::string& name) {
  if (was_there_) refuse_existing((final_ / name).string(), !output_.when_taken);
  added_.insert(name);
  return (hidden_ / name).string();
}

}  // namespace supertac
