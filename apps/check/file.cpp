#include <filesystem>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

Json provenance_in(const SafetensorsFile& file) {
  return parse_json_limited(value_or(file.metadata(), kProvenanceKey, "{}"));
}

// Recordings are those of the plates that the model names.
std::string hash_of_data(const SafetensorsFile& file, const std::string& data) {
  if (!std::filesystem::is_directory(data)) return hash_of_file(data);
  return hash_of_recordings(data, comma_list(value_or(file.metadata(), "plates")));
}

}  // namespace

int check_file(const Arguments& a) {
  const SafetensorsFile file = SafetensorsFile::read(a.text("FILE"));
  const bool ours = file.has_checksum();
  const Json provenance = provenance_in(file);
  Json result = {{"file", file.path()},
                 {"checksum", ours ? "ok" : "absent"},
                 {"content", content_hash(file)},
                 {"provenance", provenance}};
  a.print("checksum   " +
          std::string(ours ? "ok" : "absent: written by another program, damage cannot be seen"));
  a.print("content    " + result["content"].get<std::string>());
  if (provenance.empty()) a.print("provenance none: made by another program or an older version");
  for (const auto& [key, value] : provenance.items()) {
    if (key != "parents") a.print(left_aligned(key, 11) + value.get<std::string>());
  }
  const Json parents = provenance.value("parents", Json::object());
  for (const auto& [name, hash] : parents.items())
    a.print("from       " + name + " " + hash.get<std::string>());
  bool matches = true;
  if (a.given("OTHER")) {
    const std::string found = hash_of_data(file, a.text("OTHER"));
    matches = false;
    for (const auto& [name, hash] : parents.items()) matches = matches || hash == found;
    a.print(a.text("OTHER") + ": content " + found +
            (matches ? ", which it was made from" : ", which it was NOT made from"));
    result["data"] = {{"path", a.text("OTHER")}, {"content", found}, {"matches", matches}};
  }
  a.write_json(result);
  return ours && matches ? kExitOk : kExitFailed;
}

}  // namespace supertac
