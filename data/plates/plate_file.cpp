#include "data/plates/plate_file.h"

#include <filesystem>
#include <stdexcept>

#include "data/plates/stl.h"
#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {

namespace fs = std::filesystem;

bool is_unknown_plate(const std::string& name) { return name.starts_with("unknown"); }

Plate plate_in_folder(const std::string& name, const std::string& folder) {
  if (is_unknown_plate(name))
    throw std::invalid_argument(
        "these signals have no truth to train on or score. Learn from simulated presses (supertac-simulate "
        "--sensor FILE --presses N), film what presses (supertac-import --truth), or slide over a plate that "
        "is known (supertac-import --plate NAME)");
  if (!Plate::is_file(name)) return Plate::named(name);
  if (name.find('/') != std::string::npos)
    throw std::invalid_argument("plate " + in_quotes(name) +
                                ": expected the name of an STL file beside the recordings, found a path");
  return Plate::named((fs::path(folder) / name).string());
}

void keep_plate_file(const std::string& path, const std::string& folder) {
  if (!Plate::is_file(path)) return;
  const auto bytes = read_file(path, kMaxStlBytes);
  const std::string copy = (fs::path(folder) / fs::path(path).filename()).string();
  if (fs::exists(copy)) {
    if (read_file(copy, kMaxStlBytes) == bytes) return;
    throw FileError(copy, "is another plate than " + path + "; rename one of them or choose another folder");
  }
  write_file(copy, bytes);
}

}  // namespace supertac
