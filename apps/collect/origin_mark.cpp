#include "apps/collect/origin_mark.h"

#include <stdlib.h>

#include <filesystem>

#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

// The place of the XDG base directory specification, which has a relative path ignored.
fs::path state_folder() {
  const char* state = getenv("XDG_STATE_HOME");
  if (state != nullptr && fs::path(state).is_absolute()) return state;
  const char* home = getenv("HOME");
  if (home != nullptr && fs::path(home).is_absolute()) return fs::path(home) / ".local/state";
  throw FileError(
      "XDG_STATE_HOME",
      "expected a folder that remembers where the printer was left, found neither it nor HOME; set one");
}

}  // namespace

OriginMark::OriginMark(const std::string& printer_port)
    : file_((state_folder() / "supertac/origin-unknown").string() + lasting_port_name(printer_port)) {}

bool OriginMark::is_set() const {
  std::error_code error;
  const bool found = fs::exists(file_, error);
  return found || error;  // what cannot be looked at may be there
}

void OriginMark::set(const std::string& why) const {
  make_directories(fs::path(file_).parent_path().string());
  write_file(file_, "the head's position is unknown until a run on this printer has ended at its origin\n" +
                        printable(why, 300));
}

// A mark of before it said why holds its first line alone.
std::string OriginMark::why() const {
  constexpr std::size_t kMost = 4096;
  const std::string text = read_text_file(file_, kMost);
  const std::size_t line = text.find('\n');
  const std::string found = line == std::string::npos ? "" : text.substr(line + 1);
  return found.empty() ? "was cut off" : printable(found, kMost);
}

void OriginMark::clear() const {
  std::error_code error;
  fs::remove(file_, error);
  if (error) throw FileError(file_, "cannot be removed: " + error.message() + "; remove it by hand");
}

}  // namespace supertac
