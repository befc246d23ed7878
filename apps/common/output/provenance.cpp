#include "apps/common/output/provenance.h"

#include <chrono>
#include <ctime>

#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"

namespace supertac {
namespace {

using Json = nlohmann::ordered_json;

struct State {
  Json stamp = Json::object();
  std::string command_line{};
  std::time_t began = std::time(nullptr);
  std::chrono::steady_clock::time_point clock = std::chrono::steady_clock::now();
};

State& state() {
  static State s;
  return s;
}

std::string utc(std::time_t time) {
  char text[32];
  std::tm parts{};
  gmtime_r(&time, &parts);
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

std::string dumped(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

std::string version() { return SUPERTAC_VERSION; }

void begin_provenance(const Arguments& a) {
  State& s = state();
  s.command_line = a.command_line();
  s.stamp = {{"command", a.deciding_options()}, {"version", version()}, {"commit", commit()}};
  if (a.declares("seed")) s.stamp["seed"] = a.text("seed");
  set_provenance(dumped(s.stamp));
}

void add_parent(const std::string& name, const std::string& hash) {
  state().stamp["parents"][name] = hash;
  set_provenance(dumped(state().stamp));
}

std::string hash_of_file(const std::string& path) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 34;
  if (path.ends_with(".safetensors")) return content_hash(SafetensorsFile::read(path));
  return sha256(read_text_file(path, kMostBytes));
}

void add_parent_file(const std::string& name, const std::string& path) {
  add_parent(name, hash_of_file(path));
}

void add_model_parents(const std::vector<std::string>& paths) {
  for (std::size_t i = 0; i < paths.size(); ++i)
    add_parent_file(paths.size() == 1 ? "model" : "model " + std::to_string(i + 1), paths[i]);
}

Json full_provenance() {
  const State& s = state();
  Json json = s.stamp;
  json["command"] = s.command_line;
  json["began"] = utc(s.began);
  json["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - s.clock).count();
  return json;
}

}  // namespace supertac
