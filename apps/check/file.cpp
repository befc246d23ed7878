// A file and what it was made from, and the chain from recordings to a picture on a microcontroller: each
// link is made again and compared with what the exported code states.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <optional>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/provenance.h"
#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "models/files/exports.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// Recordings are those of the plates that the model names.
std::string hash_of_data(const SafetensorsFile& file, const std::string& data) {
  if (!fs::is_directory(data)) return hash_of_file(data);
  return hash_of_recordings(data, comma_list(value_or(file.metadata(), "plates")));
}

constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 28;

// What stands behind `words` and spaces in a line of a header; "" where it does not.
std::string stated_in(const std::string& header, const std::string& words) {
  const std::size_t at = header.find(words);
  if (at == std::string::npos) return "";
  const std::size_t begin = header.find_first_not_of(' ', at + words.size());
  return begin == std::string::npos ? "" : header.substr(begin, header.find_first_of(" \n", begin) - begin);
}

std::string hash_in(const std::vector<ChainLink>& chain, const std::string& name) {
  const auto found = std::ranges::find(chain, name, &ChainLink::name);
  return found == chain.end() ? "" : found->hash;
}

// The rows of a table: one link after the other, as it is stated and as it was found.
class Links {
 public:
  explicit Links(const Arguments& a) : a_(a) {}

  /// `remake`: what the link is, made again; its errors are differences. "" where that was not asked for.
  void compare(const std::string& name, const std::string& stated,
               const std::function<std::string()>& remake) {
    std::string found, said;
    try {
      found = remake();
      said = found.empty() ? "not compared" : found == stated ? "ok" : "CHANGED: found " + found;
    } catch (const std::exception& error) {
      said = std::string("CHANGED: ") + error.what();
    }
    if (said.starts_with("CHANGED")) changed_.push_back(name);
    a_.print(left_aligned(name, 11) + left_aligned(stated.empty() ? "none is stated" : stated, 65) + said);
    rows_.push_back({{"link", name}, {"stated", stated}, {"found", found}, {"said", said}});
  }
  bool holds() const { return changed_.empty(); }
  int finish() const {
    a_.print(holds() ? "the chain holds" : "the chain breaks at: " + joined(changed_, ", "));
    a_.write_json({{"links", rows_}, {"changed", changed_}});
    return holds() ? kExitOk : kExitFailed;
  }

 private:
  const Arguments& a_;
  Json rows_ = Json::array();
  std::vector<std::string> changed_;
};

}  // namespace

int check_file(const Arguments& a) {
  const SafetensorsFile file = SafetensorsFile::read(a.text("FILE"));
  const bool ours = file.has_checksum();
  const Json provenance = parse_json_limited(value_or(file.metadata(), kProvenanceKey, "{}"));
  Json result = {{"file", file.path()},
                 {"checksum", ours ? "ok" : "absent"},
                 {"content", content_hash(file)},
                 {"provenance", provenance}};
  a.print("checksum   " +
          std::string(ours ? "ok" : "absent: written by another program, damage cannot be seen"));
  a.print("content    " + result["content"].get<std::string>());
  bool matches = true;
  if (a.given("OTHER")) {
    const std::string found = hash_of_data(file, a.text("OTHER"));
    const Json parents = provenance.value("parents", Json::object());
    matches = std::find(parents.begin(), parents.end(), found) != parents.end();
    a.print(a.text("OTHER") + ": content " + found +
            (matches ? ", which it was made from" : ", which it was NOT made from"));
    result["data"] = {{"path", a.text("OTHER")}, {"content", found}, {"matches", matches}};
  }
  a.write_json(result);
  return ours && matches ? kExitOk : kExitFailed;
}

int check_chain(const Arguments& a) {
  const fs::path header_file = a.text("OTHER"), source_file = fs::path(header_file).replace_extension(".c");
  const std::string header = read_text_file(header_file, kMostBytes),
                    source = read_text_file(source_file, kMostBytes), mark = "_SELF_TEST 0x";
  const std::size_t mark_at = header.find(mark);
  // Its sixteen characters, whatever they are: no other link is to be blamed for a digit that is a blank.
  const std::string picture = mark_at == std::string::npos ? "" : header.substr(mark_at + mark.size(), 16);
  const double stated_hz = parse_double(stated_in(header, "_SENSOR_HZ ")).value_or(0),
               sensor_hz = stated_hz >= 1 && stated_hz <= 100'000 ? stated_hz : 0;
  Links links(a);
  const auto compare = [&](const std::string& name, const std::function<std::string()>& remake) {
    links.compare(name, stated_in(header, "   " + name + " "), remake);
  };
  std::optional<SafetensorsFile> file;
  try {
    file = SafetensorsFile::read(a.text("FILE"));
  } catch (const FileError&) {
    compare("model", []() -> std::string { throw; });
    return links.finish();
  }
  const std::vector<ChainLink> chain = chain_of(*file);
  // The recipe says which plates were taken.
  const bool same_recipe = hash_in(chain, "recipe") == stated_in(header, "   recipe ");
  compare("recordings", [&] {
    const std::string here = hash_in(chain, "recordings");
    if (here != stated_in(header, "   recordings ")) return here.empty() ? "none in the model" : here;
    return a.given("data") && same_recipe
               ? hash_of_recordings(a.text("data"), comma_list(value_or(file->metadata(), "plates")))
               : "";
  });
  for (const char* name : {"recipe", "model"}) compare(name, [&] { return hash_in(chain, name); });
  CCode made;
  const bool remade = links.holds();
  compare("int8", [&] {
    if (remade) made = exported(*file, header_file.stem(), sensor_hz);
    return hash_in(made.chain, "int8");
  });
  compare("code", [&] {
    const std::string found = sha256(source);
    if (found != stated_in(header, "   code ") || !links.holds()) return found;
    std::string expected = made.header;
    const std::string made_picture = hash_in(made.chain, "picture");
    expected.replace(expected.find(made_picture), made_picture.size(), picture);
    if (expected != header) throw FileError(header_file, "is not what the model is exported as");
    return hash_in(made.chain, "code");
  });
  links.compare("picture", picture, [&] {
    if (a.given("picture") && a.text("picture") != picture) return a.text("picture");
    return links.holds() ? hash_in(made.chain, "picture") : "";
  });
  return links.finish();
}

}  // namespace supertac
